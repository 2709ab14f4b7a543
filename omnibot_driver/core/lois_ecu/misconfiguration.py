# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Advice on a misconfiguration, found in the settings or in what the board sends."""

import math
import re
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.lois_ecu.messages import Report, Setting, TerminalLine, Ticks
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

GAINS: Final = (
    Setting.LEFT_KP,
    Setting.LEFT_TN,
    Setting.LEFT_TD,
    Setting.RIGHT_KP,
    Setting.RIGHT_TN,
    Setting.RIGHT_TD,
)
"""Gains of the speed controllers. The board does not report their values."""
OWN_GAINS: Final = (
    "the speed controllers run with the board's own {}. Run `calibrate step`, or set these"
    " parameters. The gains of the public firmware make a wheel oscillate, so the robot does not"
    " hold its course. Odometry after 5 m is then wrong by 0.04 m on average (by at most 0.16 m in"
    " nearly all drives, and by 2.2 m in one of 150), even with wheels of the configured size"
)
"""Advice if the user has not set all gains; the braces stand for the names of the missing gains.

The errors in the text were measured in 150 forward drives with a build of the public firmware.
"""
TOO_FAST: Final = 5
TOO_FAST_ADVICE: Final = (
    "the tick counts change faster than a wheel can turn, so the driver rejects the tick reports,"
    " and odom does not show the motion: check `ticks_per_revolution`"
)
"""Advice for tick counts that change too fast. The user gets it when the number of tick reports
rejected in a row reaches ``TOO_FAST``."""
NO_TICKS_S: Final = 4.0
LONGEST_STEP_S: Final = 0.5
NO_TICKS_ADVICE: Final = (
    "the board sends other reports, but no ticks, so there is no odometry, and a stop cannot be"
    " confirmed; set `ticks_period`"
)
"""Advice after ``NO_TICKS_S`` (in s) with other reports, but without ticks.

Of each pause between two reports, at most ``LONGEST_STEP_S`` (in s) counts.
"""
LOOK_AT: Final = 600
"""Number of received bytes without a valid line after which the user gets advice. The board sends
at least 70 bytes per second, so the advice comes within 9 s.
"""

_LINE: Final = re.compile(rb":[0-9a-fA-F]+\r?\n")
_NMEA: Final = re.compile(rb"[$!][A-Z]{2}[A-Z]{3},")
_OMNIBOT: Final = re.compile(rb"\xff[\xfa\xfb\xfc]|Paused: ")


class Suspicion:
    """Detection of a misconfiguration from the received bytes.

    Call ``look`` with all received bytes. After a read with reports, call ``understood()`` to clear
    the advice, and ``heard`` to check for ticks.

    * ``advice``: what the user should check, or None.
    * ``no_ticks``: whether the board sends reports, but no ticks.
    """

    def __init__(self) -> None:
        self.advice: str | None = None
        self._seen = b""
        self.connect()

    def connect(self) -> None:
        """Begin a new connection: measure the time without tick reports anew."""
        self._heard_at_s, self._without_s = math.inf, 0.0

    @property
    def no_ticks(self) -> bool:
        return self._without_s > NO_TICKS_S

    def heard(self, reports: Sequence[Report], now: float) -> None:
        """Record the reports that were read at ``now``."""
        step_s = min(max(now - self._heard_at_s, 0.0), LONGEST_STEP_S)
        self._heard_at_s = now
        if any(isinstance(report, Ticks) for report in reports):
            self._without_s = 0.0
        elif not all(isinstance(report, TerminalLine) for report in reports):
            self._without_s += step_s

    def understood(self) -> None:
        """Clear the advice. A decoded report shows that the board is not misconfigured."""
        self._seen, self.advice = b"", None

    def look(self, data: bytes) -> None:
        """Examine more received bytes.

        Set ``advice`` when ``LOOK_AT`` bytes have given no report.
        """
        if not data:
            return
        self._seen = (self._seen + data)[-2 * LOOK_AT :]
        if len(self._seen) >= LOOK_AT:
            self.advice = _advice(self._seen)


def own_gains(settings: LoisEcuSettings) -> str:
    """Return the names of the gains that the user has not set.

    The result is empty if all gains are set. In duty mode, it is always empty.
    """
    if settings.drive_mode != "rpm":
        return ""
    return ", ".join(gain.name.lower() for gain in GAINS if gain not in settings.written)


def _advice(seen: bytes) -> str:
    if len(_OMNIBOT.findall(seen)) >= 5:
        return (
            "the port carries an OmniBot board's frames: set board to omnibot, or choose the ECU's"
            " port"
        )
    if len(_NMEA.findall(seen)) >= 3:
        return (
            "the port carries NMEA sentences: they come from a GPS or a compass, or from the"
            " board in a terminal mode; set terminal_mode to host, or choose another port"
        )
    lengths = [len(line.replace(b"\r", b"")) for line in _LINE.findall(seen)]
    if len(lengths) >= 5:
        usual = max(set(lengths), key=lengths.count)
        if usual == 12:
            return "lines arrive without checksums; set the parameter `checksum` to false"
        if usual == 14:
            return "lines arrive with wrong checksums; check the cable and the baud rate"
        return (
            f"lines of {usual} characters come instead of lines of 14: this is another firmware or"
            " board"
        )
    if sum(byte > 126 for byte in seen) > len(seen) / 10:
        return "the bytes are not text: check baudrate (115200), and that the port is the ECU's"
    return "no valid line of this board; check that the port is the ECU's"
