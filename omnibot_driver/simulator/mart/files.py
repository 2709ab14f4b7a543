# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The files in which the server records motions.

This module knows the format of the files; it does not know when they are sent.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from omnibot_driver.simulator.mart.motion import Kind, Motion

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.state import ServerState

ROWS = 2000
SPINS = (Kind.SPIN, Kind.CONTROLLED_SPIN)
_NAMES = {
    Kind.LINEAR: "LinearMotionSensorData",
    Kind.REFERENCE: "RefMotionData",
    Kind.SPIN: "SpinSensorData",
    Kind.CONTROLLED_SPIN: "MCSpinSensorData",
    Kind.CONTROLLED_LINEAR: "TLinearMotionSensorData",
    Kind.MEASURED_LINEAR: "MCLinearMotionSensorData",
}


@dataclass(frozen=True, slots=True)
class FileNote:
    """The data for the server's file about a motion.

    * ``head``: first lines of the file.
    * ``rows``: number of samples in the file.
    * ``angle_deg``, ``encoder``: values at the end of the motion.
    """

    name: str
    is_turn: bool
    head: tuple[str, ...]
    rows: int
    angle_deg: float
    encoder: int

    @property
    def content(self) -> bytes:
        """Contents of the file in Latin-1, where 0xb0 is the degree sign."""
        lines = [*self.head, ""]
        for row in range(self.rows):
            part = (row + 1) / self.rows
            rate = 100.0 * self.angle_deg / self.rows
            lines.append(f"{10 * (row + 1)},,{rate:.4f},{int(self.encoder * part)}")
        return ("\n".join(lines) + "\n").encode("latin-1")


def note_of(server: "ServerState", motion: Motion) -> FileNote:
    """Return the data for the server's file about a motion. The motion must have ended."""
    record = _turn_record(motion) if motion.kind is Kind.CONTROLLED_SPIN else ()
    head = (
        *record[:1],
        server.date,
        *record[1:],
        "Gyro Z bias (\u00b0/sec): 0.000",
        f"Max speed: {motion.speed}",
        f"Direction: {'backward' if motion.backward else 'forward'}",
        f"Motion error: {motion.error}",
        f"Voltage: {server.chassis.volts:f}",
        f"Samples: {motion.sample_count}",
        "",
        "Timestamp (msec),Note,Raw Gyro Z (\u00b0/sec),Encoder count",
    )
    return FileNote(
        f"{_NAMES[motion.kind]}{int(server.clock_s)}.csv",
        motion.kind in SPINS,
        head,
        min(motion.sample_count, ROWS),
        motion.angle_deg,
        server.chassis.encoder,
    )


def _turn_record(motion: Motion) -> tuple[str, ...]:
    """Return the first lines of the log file of a controlled spin.

    The caller inserts the date after the first of these lines.
    """
    return (
        "MC Spin sensor data log",
        f"Target motion (\u00b0): {motion.target:.2f}",
        "Calculated motion (\u00b0):",
        f"  @ stop detected - {motion.angle_deg:.2f}",
        f"  @ encoder stop - {motion.angle_deg:.2f}",
    )
