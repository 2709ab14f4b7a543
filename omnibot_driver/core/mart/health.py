# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reasons not to drive: faults of the motor board, a dead IMU, an obstacle, or a wrong server.

This module knows infrequent measurements and their limits; it does not know how to stop the robot.
The caller passes the time.
"""

import math
from collections import Counter, deque
from typing import Final

from omnibot_driver.core.mart.goal import INCH_M
from omnibot_driver.core.mart.imu_proof import ImuProof
from omnibot_driver.core.mart.readings import (
    BatteryReading,
    DockedReading,
    Side,
    SonarReading,
)
from omnibot_driver.core.mart.relative_heading import MOST_RAD, OLD_RAD
from omnibot_driver.core.mart.replies import Ok
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.mart.words import DOCKED, MCSTAT, SFC, SRC, UNSUPPORTED, VOLTS, Word
from omnibot_driver.core.readings import ExtraReading, Reading

BITS: Final = {
    4: "motor 1 trip",
    8: "motor 2 trip",
    16: "motor 1 short",
    32: "motor 2 short",
    64: "supply above 30 V",
    128: "supply below 16 V",
}
NO_READ: Final = 255
HALTING: Final = 4 | 8 | 16 | 32
FRONT_IN, REAR_IN = 19, 15
"""Distances in inches (front, rear): the controller stops the robot if an obstacle is nearer."""
SEEN_FOR_S: Final = 2.0
LOWEST_V, HIGHEST_V = 5.0, 40.0
ENCODER_FAILS: Final = 3
LIKE: Final = {VOLTS: 0.5, SFC: 3, SRC: 3}
"""Largest difference between two readings that are regarded as equal, in V (VOLTS) or inches."""
OFTEN: Final = {VOLTS: 2, SFC: 3, SRC: 3}
"""Number of equal readings in a row that the driver requires before it uses an uncertain reading.

A reading is uncertain if its reply may answer another query.
"""
SAME_V: Final = 0.015
HEADING_CHANGES: Final = 3
STRAYS_S: Final = 3.0
"""Limit in s for the time since the server reported a failure of RM (forward drive). If the robot
moves without a command within this time, the driver assumes that RM has started the motors."""


class Health:
    """The health of robot and server.

    * ``stranger``: name of a server that is not a motion controller, else empty.
    * ``heading_told``: kinds of motion, besides RM (forward drive), in which the server reports the
      heading.
    * ``heading_changes``: number of changes of the reported heading in the current motion.
    * ``reference_fails``: number of starts of RM in a row that have failed.
    * ``outlived``: whether the server's stop port may still wait for the end of an old motion. If
      so, the next stop can fail.
    """

    def __init__(self, imu: ImuProof) -> None:
        self._imu = imu
        self.outlived = self._may_be_restarted = False
        self.connect()

    def connect(self) -> None:
        """Begin a new connection. Forget all measurements, but not that the stop port may hang."""
        self.heading_told: set[Motion] = set()
        self.heading_changes = 0
        self._defective = False
        self.reference_fails = 0
        self._reference_failed_s = -math.inf
        self.stranger = ""
        self.status: int | None = None
        self.volts: float | None = None
        self._status_before: int | None = None
        self._encoder_fails = 0
        self._encoder_known = True
        self._before: dict[Word, float] = {}
        self._alike: Counter[Word] = Counter()
        self._voltages: deque[float] = deque(maxlen=4)
        self._sonars_in: dict[Side, tuple[int, float]] = {}

    def measured(
        self, word: Word, reply: Ok, now: float, *, uncertain: bool = False
    ) -> list[Reading]:
        """Return the readings from a reply about voltage, motor board, dock or sonars.

        ``uncertain``: the reply may answer another query, so several equal readings are required.
        """
        if word is VOLTS:
            self._voltages.append(reply.number)
        if word in LIKE:
            before = self._before.get(word)
            alike = before is not None and abs(reply.number - before) <= LIKE[word]
            self._alike[word] = self._alike[word] + 1 if alike else 1
            self._before[word] = reply.number
            if uncertain and self._alike[word] < OFTEN[word]:
                return []
            if uncertain and word is not VOLTS and self._is_of_another(word, reply.number):
                return []
        if word is MCSTAT:
            self._status(int(reply.number))
        elif word is VOLTS and LOWEST_V <= reply.number <= HIGHEST_V:
            self.volts = reply.number
            return [ExtraReading(BatteryReading(reply.number))]
        elif word is DOCKED:
            return [ExtraReading(DockedReading(reply.text == "true"))]
        elif word in (SFC, SRC):
            side: Side = "front" if word is SFC else "rear"
            inches = int(reply.number)
            self._sonars_in[side] = inches, now
            distance_m = inches * INCH_M if inches >= 0 else math.inf
            return [ExtraReading(SonarReading(side, distance_m))]
        return []

    def _is_of_another(self, word: Word, inches: float) -> bool:
        """Return whether a sonar's distance is probably the reply to another query.

        True if ``inches`` is 0, or if it equals the last reading of the other sonar.
        """
        other = self._before.get(SRC if word is SFC else SFC)
        return inches == 0 or (inches > 0 and inches == other)

    def is_voltage(self, number: float) -> bool:
        """Return whether ``number`` is a battery voltage, in V, that was reported recently."""
        return any(abs(number - volts) < SAME_V for volts in self._voltages)

    def _status(self, bits: int) -> None:
        """Record the status of the motor board.

        A status other than 0 is believed only if it comes twice in a row, because a late encoder
        count can look like a status.
        """
        if not 0 <= bits <= NO_READ:
            return
        before, self._status_before = self._status_before, bits
        if bits == before or bits == 0:
            self.status = bits

    def outlives(self) -> None:
        """Record that the server's stop port may still wait for the end of an old motion.

        Call this method when the server answers a stop: the answer shows that the server was not
        restarted.
        """
        self.outlived, self._may_be_restarted = True, False

    def restarted(self) -> None:
        """Record that the server was restarted. After a restart, its stop port cannot hang."""
        self.outlived = self._may_be_restarted = False

    def was_silent(self) -> None:
        """Record that the server may have been restarted. ``rests`` finds out whether it was."""
        self._may_be_restarted = True

    def rests(self, heading_rad: float) -> None:
        """Find out from the heading of a robot at rest whether the server was restarted.

        Only a heading near zero shows a restart: gyro drift, or a user who turns the robot, can
        change the heading too.
        """
        if not self.outlived or not abs(heading_rad) < MOST_RAD:
            return
        if self._may_be_restarted and abs(heading_rad) <= OLD_RAD:
            self.restarted()
        self._may_be_restarted = False

    def encoder_failed(self, reason: str) -> None:
        """Record that the query of the encoder count (ENC) was answered by ``fail``.

        ``reason``: the text after ``fail``.
        """
        self._encoder_fails += 1
        self._encoder_known = reason != UNSUPPORTED

    def encoder_answers(self) -> None:
        """Record that the server answered the query of the encoder count (ENC) with a count."""
        self._encoder_fails = 0

    def heading_changed(self, motion: Motion) -> None:
        """Record that the reported heading has changed during a motion of the kind ``motion``.

        After HEADING_CHANGES changes, the driver assumes that the server updates the heading in all
        motions of this kind.
        """
        self.heading_changes += 1
        if self.heading_changes >= HEADING_CHANGES:
            self.heading_told.add(motion)

    def reference_failed(self, now: float) -> None:
        """Record that RM (forward drive) has failed, and that the server has not named the cause.

        The server's reply contained no text after ``fail``, or only said that no wheel has turned.
        """
        self.reference_fails += 1
        self._reference_failed_s = now

    def reference_answers(self) -> None:
        """Record that RM (forward drive) was answered by ``ok``."""
        self.reference_fails, self._reference_failed_s = 0, -math.inf

    def strays(self, now: float) -> None:
        """Record that the robot moves although no motion is commanded.

        If RM (forward drive) has failed in the last STRAYS_S, the server is regarded as defective:
        the failed RM seems to have started the motors.
        """
        self._defective |= now < self._reference_failed_s + STRAYS_S

    def volts_or(self, nominal: float) -> float:
        """Return the battery voltage in V, or ``nominal`` before the first report."""
        return nominal if self.volts is None else self.volts

    @property
    def bits(self) -> str:
        """The faults that the motor board reports (MCSTAT), as text.

        The text is "none" if there are no faults. Before the first status, it is "unknown".
        """
        if self.status is None:
            return "unknown"
        if self.status == NO_READ:
            return "motor board does not answer"
        return ", ".join(name for bit, name in BITS.items() if self.status & bit) or "none"

    @property
    def tripped(self) -> str:
        """The motor board's faults that forbid driving; empty without such faults."""
        if self._encoder_fails >= ENCODER_FAILS or self.status == NO_READ:
            return "nothing (the query ENC or MCSTAT fails)"
        return self.bits if (self.status or 0) & HALTING else ""

    @property
    def refusal(self) -> str:
        """Why the driver refuses motion, with a remedy; empty while motion is allowed."""
        if self.stranger:
            return (
                f"the server is not a motion controller; it calls itself '{self.stranger}'; check"
                " `port`"
            )
        if self._encoder_fails >= ENCODER_FAILS and not self._encoder_known:
            return (
                "the server does not know the command ENC (encoder count), so the driver cannot"
                " measure the motion of the robot: update the server"
            )
        if self.tripped:
            return f"the motor board reports {self.tripped}: check motors, wiring and power"
        if self._imu.dead:
            return (
                "the IMU does not answer (MPU6050 connection lost): check its wiring, and"
                " restart server and driver if this persists"
            )
        if self.outlived:
            return (
                "the server answers again after the loss of its connection, but was not restarted."
                " It may not obey the next stop: restart the server, then the driver"
            )
        if self._defective:
            return (
                "this server answers 'fail' to RM (drive forward) although the robot moves: update"
                " the server"
            )
        return ""

    def obstacle(self, motion: Motion, now: float) -> bool:
        """Return whether the sonar in the direction of motion has recently seen a near obstacle."""
        side: Side = "rear" if motion is Motion.REVERSE else "front"
        least = REAR_IN if motion is Motion.REVERSE else FRONT_IN
        inches, at_s = self._sonars_in.get(side, (-1, -math.inf))
        return 0 <= inches < least and now - at_s < SEEN_FOR_S
