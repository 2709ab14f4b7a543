# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Advice on what is misconfigured, by bytes that are not lines and by the settings themselves.

It is one sentence at most. Advice by bytes (another board, a wrong setting) is given only while
lines are not understood. Works on bytes and settings, without times.
"""

import re
from typing import Final

from omnibot_driver.core.lois_ecu.messages import Setting
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

GAINS: Final = (
    Setting.LEFT_KP,
    Setting.LEFT_TN,
    Setting.LEFT_TD,
    Setting.RIGHT_KP,
    Setting.RIGHT_TN,
    Setting.RIGHT_TD,
)
"""Gains of the speed controllers; the board does not report which values it has."""
OWN_GAINS: Final = (
    "the speed controllers run with the board's own {}. With those of the public firmware a"
    " wheel oscillates, so the robot does not hold its course, and after 5 m odometry is wrong"
    " by 0.04 m on average, in a few drives by 0.2 to 2 m. Run calibrate step, or set these"
    " parameters"
)
"""Advice for missing gains. Its figures are from 150 forward drives of the compiled firmware with
wheels of the right size."""
LOOK_AT: Final = 600
"""Number of bytes without a valid line after which advice is given: the board sends at least 70 of
them a second."""

_LINE: Final = re.compile(rb":[0-9a-fA-F]+\r?\n")
_NMEA: Final = re.compile(rb"[$!][A-Z]{2}[A-Z]{3},")
_OMNIBOT: Final = re.compile(rb"\xff[\xfa\xfb\xfc]|Paused: ")


class Suspicion:
    """Detection of a misconfiguration by received bytes.

    Call ``look`` with all bytes, and ``understood`` when some of them were a report.
    """

    def __init__(self) -> None:
        self.advice: str | None = None
        self._seen = b""

    def understood(self) -> None:
        """Clear the advice, as a valid line shows that it is the right board."""
        self._seen, self.advice = b"", None

    def look(self, data: bytes) -> None:
        """Examine more bytes; give advice when enough of them were not understood."""
        if not data:
            return
        self._seen = (self._seen + data)[-2 * LOOK_AT :]
        if len(self._seen) >= LOOK_AT:
            self.advice = _advice(self._seen)


def own_gains(settings: LoisEcuSettings) -> str:
    """Return the names of gains that keep the board's values; empty if not in RPM mode."""
    if settings.drive_mode != "rpm":
        return ""
    return ", ".join(gain.name.lower() for gain in GAINS if gain not in settings.written)


def _advice(seen: bytes) -> str:
    if len(_OMNIBOT.findall(seen)) >= 5:
        return (
            "the port carries an OmniBot board's frames: set board to omnibot, or choose its port"
        )
    if len(_NMEA.findall(seen)) >= 3:
        return (
            "the port carries NMEA sentences: it is a GPS or a compass, or the board is in a"
            " terminal mode; set terminal_mode to host, or choose another port"
        )
    lengths = [len(line.replace(b"\r", b"")) for line in _LINE.findall(seen)]
    if len(lengths) >= 5:
        usual = max(set(lengths), key=lengths.count)
        if usual == 12:
            return "lines arrive without checksums; set the parameter `checksum` to false"
        if usual == 14:
            return "lines arrive with wrong checksums; check the cable and the baud rate"
        return f"lines of {usual} characters come instead of 14: this is another firmware or board"
    if sum(byte > 126 for byte in seen) > len(seen) / 10:
        return "the bytes are not text: check baudrate (115200), and that the port is the ECU's"
    return "no valid line of this board; check that the port is the ECU's"
