# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""State of a simulated server and its robot: true values, and the values that the server assumes.

This module does not know commands, or how time passes.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from omnibot_driver.simulator.mart.chassis import Chassis, sight_m
from omnibot_driver.simulator.mart.files import FileNote
from omnibot_driver.simulator.mart.imu import Imu
from omnibot_driver.simulator.mart.motion import INCHES_PER_M, Kind, Motion
from omnibot_driver.simulator.mart.settings import MartSettings

COMMAND, STOP = 0, 1
"""``COMMAND``, ``STOP``: indices of the command port and of the stop port."""
NEAR_READINGS_S = 0.15
"""Duration in s of three sonar readings. The server needs three readings to confirm that an
obstacle is near."""
FARTHEST_IN = 254
UNSIGNED_S = 2**64 / 1000
"""Time in s that the server adds to a negative duration, because the server counts ms in an
unsigned number."""
FILES, LOG_LINES = 100, 10_000

Then = Callable[..., None]


class Waiter(NamedTuple):
    """A port whose thread waits until a motion of ``kind`` has started or stopped."""

    port: int
    kind: Kind
    then: Then | None
    args: tuple[Any, ...]


class ServerState:
    """The state of the server, its robot and its surroundings.

    * ``crashed``: why the server ended; empty while it runs.
    * ``alarm``: the kind of motion that the server supervises now, or None.
    * ``starting``: the kind of motion whose command is not answered yet, or None.
    * ``custom``: parameters that the commands SLMP and SSP have set.
    * ``sampling_since_s``: time at which a motion began to use a sonar, or -1.
    * ``front_m``, ``rear_m``, ``dock_m``: distances from the start to the walls and to the dock.

    A test may change the distances, the chassis and the IMU during a run.
    """

    def __init__(self, settings: MartSettings) -> None:
        self.settings = settings
        self.quirks = settings.quirks
        self.now_s = 0.0
        self.chassis = Chassis(settings)
        self.imu = Imu(settings)
        self.front_m, self.rear_m, self.dock_m = settings.front_m, settings.rear_m, settings.dock_m
        self.clock_offset_s = float(settings.clock_s)
        self.hit_wall = False
        self.files: dict[str, FileNote] = {}

    def begin(self) -> None:
        """Reset all that the server's program knows, as at its start."""
        self.crashed = ""
        self.motions = [Motion(kind) for kind in Kind]
        self.alarm: Kind | None = None
        self.starting: Kind | None = None
        self.manual = self.recording = False
        self.custom: dict[str, tuple[int, int]] = {}
        self.last_reply = ""
        self.last_files: dict[str, str] = {}
        self.log: list[str] | None = None
        self.log_name = ""
        self.sampling_since_s = -1.0
        self._reference_clock_s: float | None = None
        self.busy = False
        self.waiters: list[Waiter] = []

    @property
    def hung(self) -> bool:
        """Whether the command port is permanently silent, although the server runs."""
        return any(
            waiter.port == COMMAND and waiter.kind is not self.alarm for waiter in self.waiters
        )

    @property
    def stop_port_hung(self) -> bool:
        """Whether the stop port is permanently silent, although the server runs."""
        return any(waiter.port == STOP and waiter.kind is not self.alarm for waiter in self.waiters)

    @property
    def moving(self) -> bool:
        """Whether the robot truly moves, or its motors have a command."""
        return self.chassis.moving or self.chassis.powered

    @property
    def motion(self) -> Kind | None:
        """Kind of motion that the server regards as in progress, or None."""
        return next((each.kind for each in self.motions if each.running), self.starting)

    @property
    def clock_s(self) -> float:
        """Time of the server's clock, as Unix time in s."""
        return self.now_s + self.clock_offset_s

    @property
    def date(self) -> str:
        """Date and time of the server's clock as text, in the format of the server's files."""
        return time.strftime("%m/%d/%Y  %H:%M:%S", time.gmtime(self.clock_s))

    @property
    def docked(self) -> bool:
        """Whether the robot is at its dock."""
        return self.chassis.x_m >= self.dock_m

    @property
    def driven_m(self) -> float:
        """Distance in m that the right wheel's encoder has counted since its last reset."""
        return self.chassis.counts * self.settings.metres_per_count

    @property
    def conflict(self) -> bool:
        """Whether a motion, a recording or direct motor control (MCS) blocks further motions."""
        return self.manual or self.recording or any(each.running for each in self.motions)

    def save(self, note: FileNote) -> None:
        """Store the file of the last move or turn.

        If there are more than 100 files, delete the oldest.
        """
        self.files[note.name] = note
        if len(self.files) > FILES:
            del self.files[next(iter(self.files))]
        self.last_files["TURN" if note.is_turn else "MOVE"] = note.name

    def write_log(self, text: str) -> None:
        """Add a dated line to the log, if the log is open and not full."""
        if self.log is not None and len(self.log) < LOG_LINES:
            self.log.append(f"{self.date} {text}")

    def sonar_in(self, *, backward: bool, ago_s: float = 0.0) -> int:
        """Return the reading that a sonar had ``ago_s`` seconds ago, in inches.

        The result is -1 if no wall is in range.
        """
        seen_m = sight_m(self.chassis, self.front_m, self.rear_m, backward=backward)
        way_m = self.chassis.speed_mps * ago_s
        inches = (seen_m - way_m if backward else seen_m + way_m) * INCHES_PER_M
        return int(inches) if 1.0 <= inches < FARTHEST_IN + 1 else -1

    def clearance_in(self, *, backward: bool) -> int:
        """Return the last reading, in inches, of the sonar that the current motion uses.

        -1: no reading yet, or no wall in range.
        """
        since_s = self.sampling_since_s
        if since_s < 0.0 or self.now_s - since_s < NEAR_READINGS_S:
            return -1
        return self.sonar_in(backward=backward, ago_s=NEAR_READINGS_S)

    @property
    def heading_integrates(self) -> bool:
        """Whether the server now changes the relative heading when the robot turns."""
        return self.alarm is Kind.REFERENCE or not self.quirks.heading_in_reference_moves_only

    def sample_reference(self, *, first: bool) -> None:
        """Record the time at which the server samples the IMU in a forward drive (RM).

        With the quirk ``heading_starts_off``, the first sample shifts the heading, in proportion to
        the time since the last drive.
        """
        clock_s, before_s = self.clock_s, self._reference_clock_s
        self._reference_clock_s = clock_s
        if first and before_s is not None and self.quirks.heading_starts_off:
            seconds = clock_s - before_s + (UNSIGNED_S if clock_s < before_s else 0.0)
            self.imu.heading_deg += self.imu.rate_dps / 2 * seconds
