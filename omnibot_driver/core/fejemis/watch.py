# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Checks timeouts: a board is silent, or the front wheel's angle or the pose is too old.

The module knows when lines came; it does not know what they contain.
"""

import math
from typing import Final

from omnibot_driver.core.fejemis.front_wheel import OLDEST_S, FrontWheel
from omnibot_driver.core.fejemis.half import NEEDED, SILENT_S
from omnibot_driver.core.fejemis.ports import PARAMETERS, Ports
from omnibot_driver.core.fejemis.told import Told

NO_POSE_S: Final = 0.25
"""Age of the last pose in s above which the robot is stopped."""
NO_ANGLE_S: Final = 0.25
"""Time in s without an angle of the front wheel, after which brush and lift are switched off."""
FLOWS_S: Final = 0.5
UNHEARD_S: Final = 3.0
"""Time in s, from the opening of the ports, after which a silent board is reported as missing if
the other board sends.
"""
UNREAD_S: Final = 0.03
"""Longest usual time in s without a line of either board; each sends at least every 15 ms.

After a longer time, no single board is blamed: the driver may have read late.
"""
UNREAD: Final = (
    "the driver has read nothing from either board for a moment; reduce the load of the computer,"
    " or check the USB hub"
)
NO_DATA: Final = "no data from the boards; check their power and cables"
SLACK_S: Final = 1e-6


class Watch:
    """The timeouts of a Fejemis: for each board's data, the front wheel's angle, and the pose.

    * ``blind``: whether the front wheel's last angle is too old, or its sensor is faulty.
    * ``unposed``: whether the last pose is too old.
    """

    def __init__(self, ports: Ports, front: FrontWheel, told: Told) -> None:
        self._ports, self._front, self._told = ports, front, told
        self.begin()

    def begin(self) -> None:
        """Forget earlier timeouts, because new connections begin."""
        self.blind = self.unposed = self._sick = self._stalled = False
        self._missed = [False, False]
        """For each port: whether the user was notified that its board is missing."""
        self._begun_at = math.inf
        self._patient_until = -math.inf
        self._looked_at = self._heard_at = self._unread_until = -math.inf

    def stalled(self) -> None:
        """Record a stall of the driver, so that it is not regarded as silence of the boards."""
        self._stalled = True

    def open(self, now: float) -> None:
        """Record that the ports have been open since ``now``. Later calls have no effect."""
        self._begun_at = min(self._begun_at, now)

    def look(self, now: float, *, driving: bool) -> bool:
        """Check all timeouts, and add a notice about each that has newly expired.

        Return whether a data stream that driving requires has newly stopped.
        """
        self._look_at_reads(now)
        if self._stalled:
            self._stalled, self._patient_until = False, now + SILENT_S
        lost = [self._look_at(channel, now) for channel in (0, 1)]
        self._look_at_age(now, driving=driving)
        return any(lost)

    @property
    def wake_at(self) -> float:
        """Time in s at which the next timeout expires: for the front wheel's angle, or the pose."""
        times = [math.inf]
        drive = self._ports.half("drive")
        if not self.blind:
            times.append(self._front.stale_at)
        if not self.unposed and drive is not None:
            times.append(drive.came_at("pose") + NO_POSE_S + SLACK_S)
        return min(times)

    @property
    def front_unheard_at(self) -> float:
        """Time in s at which brush and lift must be off if no front wheel angle arrives before."""
        front = self._ports.half("front")
        return -math.inf if front is None else front.came_at("fwl") + NO_ANGLE_S + SLACK_S

    def _look_at(self, channel: int, now: float) -> bool:
        half, parameter = self._ports.halves[channel], PARAMETERS[channel]
        role = half.role
        silent = now - half.heard_at > SILENT_S
        if role is None or half.heartbeat is None:
            other = self._ports.halves[1 - channel]
            heard = other.role is not None and other.heartbeat is not None
            was_missed = self._missed[channel]
            self._missed[channel] = silent and now - self._begun_at > UNHEARD_S and heard
            if self._missed[channel]:
                notify = self._told.tell if was_missed else self._told.halt
                notify(
                    f"no data from the {self._ports.role(channel)} board at `{parameter}`; check"
                    " its power and cable, and whether another program uses its port",
                    now,
                )
            return False
        unheard_s = now - half.came_at(NEEDED[role])
        if unheard_s < FLOWS_S:
            if half.unsure:
                half.ready = False
            elif unheard_s <= 0.0:  # a line of this stream has just arrived
                half.ready = True
        elif half.ready and unheard_s > SILENT_S and now >= self._patient_until:
            what = "is silent" if silent else f"no longer sends `{NEEDED[role]}`"
            self._told.halt(
                f"the {role} board {what}; robot stopped. Check its power and the cable at"
                f" `{parameter}`",
                now,
            )
            half.subscribe_again()
            return True
        return False

    def _look_at_reads(self, now: float) -> None:
        """Check whether the driver has read no line of either board for ``UNREAD_S``.

        If so, neither board is blamed for missing data in the next ``OLDEST_S``.
        """
        if now - self._heard_at > UNREAD_S:
            self._unread_until = now + OLDEST_S
        self._looked_at = now
        self._heard_at = max(half.heard_at for half in self._ports.halves)

    def _look_at_age(self, now: float, *, driving: bool) -> None:
        drive = self._ports.half("drive")
        was_blind, was_unposed, was_sick = self.blind, self.unposed, self._sick
        fault = self._front.trouble
        self._sick = bool(fault)
        self.blind = not self._front.known(now)
        self.unposed = drive is None or now - drive.came_at("pose") > NO_POSE_S
        if not driving:
            if fault and not was_sick:
                self._told.tell(fault, now)
            return
        if fault:
            self._told.halt(f"{fault}; robot stopped", now)
        elif self.blind and not was_blind:
            self._told.halt("no angle of the front wheel for 60 ms; robot stopped", now)
        if self.unposed and not was_unposed:
            self._told.halt("no pose from the drive board for 0.25 s; robot stopped", now)

    @property
    def refusal(self) -> str:
        """The reason why the robot must not be driven; empty if driving is allowed."""
        if trouble := self._ports.trouble or self._front.trouble:
            return trouble
        if (self.blind or self.unposed) and self._looked_at < self._unread_until:
            silent = self._looked_at - self._heard_at >= SILENT_S
            return NO_DATA if silent and self._looked_at >= self._patient_until else UNREAD
        if self.blind:
            return "no angle of the front wheel for 60 ms; check the front board"
        if self.unposed:
            return "no pose from the drive board for 0.25 s; check the drive board and its cable"
        for half in self._ports.halves:
            if half.unsure:
                return (
                    f"the {half.role} board was silent and may have restarted; wait until its"
                    " heartbeat arrives"
                )
        return ""
