# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Assumed errors of a wheel's speed relative to its set-point, as states of the motion filter.

The errors depend on the kind of the command that the wheel follows.
"""

from typing import TYPE_CHECKING, Final

from omnibot_driver.core.lois_ecu.wheel_motion import BIAS, EXCESS

if TYPE_CHECKING:
    from omnibot_driver.core.lois_ecu.motion_filter import MotionFilter

ROUNDED: Final = 0.4
ROUNDED_STDDEV: Final = 0.15
"""Standard deviation of the amount by which the firmware rounds down a speed, in RPM.

``ROUNDED``: mean of this amount.
"""
# While a wheel rolls backward, the firmware lowers the target with each tick until the controller's
# next step. A feed-forward may make the wheel much faster still.
EXCESS_MEAN: Final = (0.1, 0.1)
EXCESS_STDDEV: Final = (0.02, 0.3)
EXCESS_CHANGE: Final = (0.0, 0.15)
"""The excess: the fraction by which a wheel that rolls backward is faster than its set-point.

* ``EXCESS_MEAN``, ``EXCESS_STDDEV``: mean and standard deviation of the excess.
* ``EXCESS_CHANGE``: standard deviation that a change of the set-point adds.

Of each pair, the first value is for the board's own controller gains, the second for the user's.
"""
DUTY_STDDEV: Final = 0.3


class SpeedErrors:
    """Errors of the wheels' speeds in the motion filter ``motion``: a bias and an excess per wheel.

    A bias is relative in duty mode, otherwise in m/s. An excess is the relative error of a backward
    speed.
    """

    def __init__(self, motion: "MotionFilter") -> None:
        self._motion = motion
        self._kinds: tuple[str, str] | None = None
        """For each wheel, the kind of the command that it follows: "rpm", "duty" or "stop"."""

    def restored(self) -> None:
        """Record that the filter has gone back to an earlier state.

        If a wheel follows a duty command, the next ``follow`` resets the errors of both wheels,
        which may come from earlier RPM set-points.
        """
        if self._kinds and "duty" in self._kinds:
            self._kinds = None

    def follow(self) -> None:
        """Reset the bias of each wheel whose kind of command has changed.

        A change also resets both wheels' excess, the relative error of a backward speed. A Stop
        after a duty command is not a change.
        """
        before = self._kinds or ("", "")
        left, right = [
            wheel.course.kind
            if wheel.course.kind == "rpm" or wheel.course.target_mps or kind == "duty"
            else "stop"
            for wheel, kind in zip(self._motion.wheels, before, strict=True)
        ]
        if (left, right) == self._kinds:
            return
        self._kinds = left, right
        estimate, rpm_mps = self._motion.filter, self._motion.rpm_mps
        for index, (kind, earlier) in enumerate(zip(self._kinds, before, strict=True)):
            if kind == earlier:
                continue
            if kind == "duty":
                estimate.forget(BIAS + index, 0.0, DUTY_STDDEV**2)
            else:
                spread = ROUNDED_STDDEV * rpm_mps
                estimate.forget(BIAS + index, ROUNDED * rpm_mps, spread**2)
        self.begin_excess()

    def begin_excess(self) -> None:
        """Reset the excess of each wheel.

        The excess is the fraction by which a wheel that rolls backward exceeds its set-point.
        """
        motion = self._motion
        for index in (0, 1):
            mean = EXCESS_MEAN[motion.tuned] if motion.holds else 0.0
            stddev = EXCESS_STDDEV[motion.tuned] if motion.holds else 0.0
            motion.filter.forget(EXCESS + index, mean, stddev**2)
