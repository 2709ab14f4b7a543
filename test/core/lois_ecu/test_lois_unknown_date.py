# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests with a GPS that reports positions, but no date.

Such a position is not a fix, and the driver requests the date.
"""

from dataclasses import replace
from functools import partial

import pytest
from lois_drives import Rig

from omnibot_driver.core.lois_ecu import SetPeriod, Stream, encode_command
from omnibot_driver.core.lois_ecu.messages import PERIOD_ONCE
from omnibot_driver.core.lois_ecu.readings import FixReading, TimeReading
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import DOCUMENTED, FIRMWARE, LoisSettings, Quirks
from omnibot_driver.simulator.lois_ecu.sensors import Fix

pytestmark = pytest.mark.slow

DAY_S = 86400
UTC_S = 20 * 365 * DAY_S
REQUEST = encode_command(SetPeriod(Stream.GPS_DATE, PERIOD_ONCE))
MOTION = (b":01", b":02")
WITH_GPS = replace(FIRMWARE, gps_is_ignored=False)
WORKS = pytest.mark.parametrize(
    "quirks",
    [DOCUMENTED, WITH_GPS],
    ids=["documented", "firmware with a GPS"],
)


class GpsRig(Rig):
    """A robot whose GPS may have no date.

    * ``dated``: whether the GPS has a date.
    * ``unknown``: what the GPS sends instead of a date.
    * ``requests``: times at which the driver requested a date, in s.
    """

    def __init__(
        self,
        quirks: Quirks,
        *,
        utc_s: int = UTC_S,
        dated: bool = False,
        unknown: tuple[int, int, int] = (0, 0, 0),
    ) -> None:
        self.sent: list[tuple[float, bytes]] = []
        self.dated, self.unknown = dated, unknown
        super().__init__(LoisSettings(quirks=quirks, running=True, utc_s=utc_s), LoisEcuSettings())
        self.board._sayings.fix = partial(self._fix, self.board._sayings.fix)  # type: ignore[method-assign]

    def _fix(self, true: "partial[Fix]", now_s: float) -> Fix:
        fix = true(now_s)
        return fix if self.dated else replace(fix, date=self.unknown)

    def say(self, data: bytes) -> None:
        self.sent += [(self.now, line) for line in data.splitlines(keepends=True)]
        super().say(data)

    @property
    def requests(self) -> list[float]:
        return [at for at, line in self.sent if line == REQUEST]

    def fixes(self) -> list[bool]:
        """Return, for each position since the last call, whether it is a fix."""
        found = [reading.valid for reading in self.readings if isinstance(reading, FixReading)]
        self.readings.clear()
        return found


@pytest.mark.parametrize(
    ("quirks", "unknown"),
    [
        (WITH_GPS, (0, 0, 0)),
        (DOCUMENTED, (80, 1, 6)),
        (WITH_GPS, (99, 8, 22)),
    ],
    ids=str,
)
def test_a_position_without_a_date_is_not_a_fix(
    quirks: Quirks, unknown: tuple[int, int, int]
) -> None:
    """A position is a fix only if the GPS also reports a date.

    Without a date, the GPS sends zeros, or the first day of a GPS epoch (1024 weeks).
    """
    rig = GpsRig(quirks, unknown=unknown)
    rig.run(6.0)
    assert not any(time.utc_s for time in rig.readings if isinstance(time, TimeReading))
    assert len(fixes := rig.fixes()) >= 4
    assert not any(fixes)
    rig.dated = True
    rig.run(5.0)
    rig.fixes()
    rig.run(4.0)
    assert len(fixes := rig.fixes()) >= 3
    assert all(fixes)


@WORKS
def test_an_unknown_date_is_requested_every_few_seconds_until_it_comes(quirks: Quirks) -> None:
    """The GPS sends zeros instead of a date. The driver requests the date every few seconds.

    The requests end only when the GPS reports a date.
    """
    rig = GpsRig(quirks)
    rig.run(5.0)
    rig.sent.clear()
    rig.run(15.0)
    assert 4 <= len(rig.requests) <= 6
    rig.dated = True
    rig.run(4.0)
    rig.sent.clear()
    rig.run(6.0)
    assert rig.requests == []


@WORKS
def test_a_request_of_the_date_keeps_away_from_motions(quirks: Quirks) -> None:
    """The robot drives, and the date is unknown. The driver requests the date.

    Each request is sent at least 15 ms after a motion line.
    """
    rig = GpsRig(quirks)
    rig.run(5.0)
    rig.sent.clear()
    rig.order(20, 20, 10.0)
    assert 2 <= len(rig.requests) <= 4
    motions = [at for at, line in rig.sent if line.startswith(MOTION)]
    for at in rig.requests:
        assert at - max(motion for motion in motions if motion <= at) >= 0.0149
    assert rig.board.truth.x_m > 1.5


@WORKS
def test_past_midnight_positions_are_fixes_and_the_time_comes_back(quirks: Quirks) -> None:
    """At midnight the GPS date changes, and the driver requests the new date at once.

    All positions stay valid fixes. At most two GPS times are unknown, and the last time has the new
    date.
    """
    rig = GpsRig(quirks, utc_s=UTC_S + DAY_S - 10, dated=True)
    rig.run(5.0)
    rig.fixes()
    rig.run(10.0)
    times = [reading.utc_s for reading in rig.readings if isinstance(reading, TimeReading)]
    assert len(fixes := rig.fixes()) >= 6
    assert all(fixes)
    assert times.count(None) <= 2
    known = [time for time in times if time is not None]
    assert known[-1] // DAY_S == known[0] // DAY_S + 1
    assert sum(at >= 10 for at in rig.requests) <= 2


def test_no_date_is_requested_from_a_board_that_ignores_its_gps() -> None:
    """The public firmware sends zeros as position, time and date. The driver requests no date."""
    rig = GpsRig(FIRMWARE, dated=True)
    rig.run(5.0)
    rig.sent.clear()
    rig.run(10.0)
    assert rig.requests == []


def test_no_date_is_requested_where_dates_come_periodically() -> None:
    """The user has set a period for dates.

    The driver requests no date, because a request would end the period.
    """
    rig = GpsRig(DOCUMENTED)
    rig.driver.settings = LoisEcuSettings(
        periods_ms={Stream.TICKS: 200, Stream.GPS_DATE: 1000, Stream.GPS_POSITION: 1000}
    )
    rig.run(6.0)
    rig.sent.clear()
    rig.run(10.0)
    assert rig.requests == []
    assert not any(rig.fixes())
    rig.dated = True
    rig.run(2.5)
    assert rig.fixes()[-1]
