# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Steers the robot by keys, with a dead man's switch; must not know ROS or terminals.

Each pressed key moves the robot only briefly: a terminal does not report its release.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist

FIRST_S: Final = 0.6
"""Time in s for which a newly pressed key moves the robot. Before this time is over, a keyboard
begins to repeat the key: it does so after 0.25 s to 0.6 s."""
REPEAT_S: Final = 0.3
"""Time in s for which a repeated key moves the robot. So the robot keeps moving if several
repetitions are lost or late."""
ASLEEP_S: Final = 0.5
"""Longest time in s between two calls of ``command`` while the program runs.

A longer time is regarded as a suspension of the program, and earlier keys are discarded.
"""
DEAF_S: Final = 0.3
"""Time in s for which keys do not steer after the program was suspended.

Keys that were pressed during the suspension still arrive in this time.
"""
ZEROS: Final = 5
"""Number of zero commands that follow a motion.

After them the monitor publishes nothing, because other nodes may want to drive.
"""
LEVELS: Final = 10
NOTHING: Final = ("", -math.inf)
HALT: Final = BodyTwist(0.0, 0.0, 0.0)

MOTIONS: Final = {
    **dict.fromkeys(("w", "up"), (1, 0, 0)),
    **dict.fromkeys(("s", "down"), (-1, 0, 0)),
    **dict.fromkeys(("a", "left"), (0, 1, 0)),
    **dict.fromkeys(("d", "right"), (0, -1, 0)),
    "j": (0, 0, 1),
    "l": (0, 0, -1),
}
"""For each steering key, the signs of three velocities: forward, to the left, turning left."""


class DeadMan:
    """A dead man's switch that converts pressed keys to commands.

    The caller must call ``command`` regularly. Another thread may call ``press`` without a lock.
    """

    def __init__(self) -> None:
        self.level = 3
        self.fastest = (0.5, 0.5)
        """Linear speed in m/s and angular speed in rad/s at the highest speed level."""
        self.has_driven = False
        self._held = NOTHING
        self._zeros = 0
        self._asked_s = math.inf
        self._deaf_until_s = -math.inf

    def press(self, key: str, now_s: float) -> bool:
        """Handle a pressed key; return whether it is a steering key.

        A key that was pressed while the program was suspended does not move the robot.
        """
        if key not in MOTIONS:
            return False
        self._notice_sleep(now_s)
        if now_s < self._deaf_until_s:
            return True
        before, until_s = self._held
        lasts_s = REPEAT_S if key == before and now_s < until_s else FIRST_S
        self._held = key, now_s + lasts_s
        return True

    def stop(self) -> None:
        """Command zero velocity, even while a key is held."""
        self._held = NOTHING

    def change_speed(self, steps: int) -> None:
        """Change the speed level by ``steps``; level 10 is full speed, level 1 a tenth of it."""
        self.level = min(max(self.level + steps, 1), LEVELS)

    @property
    def speeds(self) -> tuple[float, float]:
        """Linear and angular speed at the present level, in m/s and rad/s."""
        part = self.level / LEVELS
        return part * self.fastest[0], part * self.fastest[1]

    def command(self, now_s: float) -> BodyTwist | None:
        """Return the command to publish now; None if there is none.

        The command is a motion while a key moves the robot, and zero five times (``ZEROS``)
        afterwards.
        """
        self._notice_sleep(now_s)
        self._asked_s = now_s
        key, until_s = self._held
        if now_s < until_s:
            self._zeros, self.has_driven = ZEROS, True
            ahead, aside, turn = MOTIONS[key]
            linear, angular = self.speeds
            return BodyTwist(ahead * linear, aside * linear, turn * angular)
        if self._zeros:
            self._zeros -= 1
            return HALT
        return None

    def _notice_sleep(self, now_s: float) -> None:
        if now_s - self._asked_s > ASLEEP_S:
            self._held, self._deaf_until_s = NOTHING, now_s + DEAF_S
