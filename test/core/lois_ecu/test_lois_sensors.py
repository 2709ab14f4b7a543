# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the readings of GPS, clock and compass of a LOIS ECU."""

import math
from datetime import date

import pytest
from lois_drives import Rig, nominal

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.lois_ecu import GpsDate, GpsTime, Stream, encode_report
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.messages import Heading
from omnibot_driver.core.lois_ecu.readings import (
    FixReading,
    HeadingReading,
    TimeReading,
)
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import DOCUMENTED, LoisSettings


def test_gps_and_compass_come_in_si_units_and_enu() -> None:
    """The readings are in SI units, and a yaw of 0 points east.

    The time is in UTC. A position of 0/0 is not a fix.
    """
    rig = Rig(
        LoisSettings(quirks=DOCUMENTED),
        LoisEcuSettings(periods_ms={Stream.TICKS: 200, Stream.GPS_DATE: 1000}),
    )
    rig.run(6.0)
    fixes = [reading for reading in rig.readings if isinstance(reading, FixReading)]
    assert fixes[-1].valid
    assert fixes[-1].latitude_deg == pytest.approx(48.1, abs=1e-5)
    headings = [reading for reading in rig.readings if isinstance(reading, HeadingReading)]
    assert headings[-1].yaw_rad == pytest.approx(0.0, abs=0.02)
    times = [reading.utc_s for reading in rig.readings if isinstance(reading, TimeReading)]
    assert times[-1] is not None
    day_s = 86400
    simulated = date(2020, 1, 1).toordinal() - date(1970, 1, 1).toordinal()
    assert times[-1] - simulated * day_s == pytest.approx(rig.now, abs=1.5)
    rig = Rig(nominal("firmware"))
    rig.run(5.0)
    fixes = [reading for reading in rig.readings if isinstance(reading, FixReading)]
    assert fixes
    assert not any(fix.valid for fix in fixes)


@pytest.mark.parametrize(
    ("day", "utc_s"),
    [
        (GpsDate(0, 1, 1), 946684800),
        (GpsDate(0, 2, 29), 951782400),
        (GpsDate(0, 3, 1), 951868800),
        (GpsDate(26, 12, 31), 1798675200),
    ],
    ids=str,
)
def test_a_date_is_seconds_of_utc(day: GpsDate, utc_s: int) -> None:
    """A date and a time become UTC seconds. The expected seconds are those of ``date -u +%s``."""
    ecu = LoisConversation(LoisEcuSettings())
    found = ecu.receive(encode_report(day) + encode_report(GpsTime(0, 0, 1)), 0.0)
    assert found == [TimeReading(utc_s + 1)]


def test_past_midnight_the_time_is_unknown_until_a_new_date_comes() -> None:
    """Just after midnight, the last date that the board has sent is that of the day before.

    The driver regards the time as unknown until a new date arrives.
    """
    ecu = LoisConversation(LoisEcuSettings())
    said = [GpsDate(26, 11, 22), GpsTime(23, 59, 59), GpsTime(0, 0, 1), GpsDate(26, 11, 23)]
    found: list[object] = []
    for at, report in enumerate([*said, GpsTime(0, 0, 2)]):
        found += ecu.receive(encode_report(report), float(at))
    before, unknown, after = (item for item in found if isinstance(item, TimeReading))
    assert unknown == TimeReading(None)
    assert before.utc_s is not None
    assert after == TimeReading(before.utc_s + 3)


def test_after_a_day_without_a_time_the_old_date_is_not_used() -> None:
    """The board reports the time, then nothing for 25 hours, and then the time again.

    The old date is wrong by a day, so the time is unknown until a new date arrives.
    """
    ecu = LoisConversation(LoisEcuSettings())
    said = encode_report(GpsDate(26, 11, 22)) + encode_report(GpsTime(9, 0, 0))
    assert ecu.receive(said, 0.0) != [TimeReading(None)]
    later_s = 25 * 3600.0
    assert ecu.receive(encode_report(GpsTime(10, 0, 0)), later_s) == [TimeReading(None)]
    said = encode_report(GpsDate(26, 11, 23)) + encode_report(GpsTime(10, 0, 1))
    assert ecu.receive(said, later_s + 1.0) != [TimeReading(None)]


@pytest.mark.parametrize("day", [GpsDate(26, 2, 31), GpsDate(26, 2, 29), GpsDate(26, 4, 31)])
def test_a_date_that_the_calendar_does_not_have_is_not_used(day: GpsDate) -> None:
    """The board reports the 31st of February. The driver does not use the 3rd of March instead."""
    ecu = LoisConversation(LoisEcuSettings())
    found = ecu.receive(encode_report(day) + encode_report(GpsTime(9, 0, 0)), 0.0)
    assert found == [TimeReading(None)]


def test_declination_turns_the_heading() -> None:
    """A declination is set, positive to the east. The yaw is pi/2 − (heading + declination)."""
    ecu = LoisConversation(LoisEcuSettings(declination_rad=0.1))
    found = ecu.receive(encode_report(Heading(90)) * 3, 0.0)
    assert found[-1] == HeadingReading(pytest.approx(-0.1))


@pytest.mark.slow
def test_false_headings_at_north_are_refused() -> None:
    """The public firmware averages headings around north wrongly: 359°, 1° and 1° give 120°.

    The driver rejects such headings.
    """
    rig = Rig(nominal("firmware"))
    rig.run(4.0)
    rig.readings.clear()
    errors = []
    for _ in range(200):
        before = len(rig.readings)
        rig.order(-10, 10, 0.1)
        for reading in rig.readings[before:]:
            if isinstance(reading, HeadingReading):
                off = math.remainder(reading.yaw_rad - rig.board.truth.yaw_rad, math.tau)
                errors.append(abs(off))
    assert len(errors) > 30
    assert max(errors) < math.radians(30)
    assert rig.driver._translation.headings.refused > 0


def test_headings_are_accepted_after_a_reset_of_the_odometry() -> None:
    """The odometry is reset while the robot faces 120°.

    The driver still accepts headings of 120°, because the reset does not change the heading that
    the driver expects.
    """
    ecu = LoisConversation(LoisEcuSettings())
    headings, ecu.translation.odometry.estimates.pose = (
        encode_report(Heading(120)) * 20,
        Pose(0, 0, -2.094),
    )
    assert ecu.receive(headings, 0.0)
    ecu.reset_odometry()
    assert ecu.receive(headings, 4.0)
