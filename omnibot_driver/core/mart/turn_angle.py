# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The angle of a turn on the spot: as the wheel measures it, and as the server reports it.

The reply to SM reports the angle of R and L. The record of a controlled turn contains the angle of
MCR and MCL. Both come from the gyro, so they replace the angle of the wheel. This module knows
angles in rad; it does not know the pose.
"""

from typing import Final

TOLD_RAD, TOLD_PART = 0.05, 0.3
"""Largest accepted difference between a reported turn and the turn measured at the wheel.

It is TOLD_RAD (rad), plus TOLD_PART of the wheel's turn. A reported number that differs by more is
regarded as the answer to another query.
"""
NO_CORRECTION: Final = 0.0


class TurnAngle:
    """The angle of the present turn on the spot, or of the last one.

    Each correction is the angle in rad by which the heading of the pose must be changed.

    ``spun_rad``: the turn that the wheel has measured; after ``record`` the recorded turn.

    ``told_rad``: the turn that the server has reported in its reply to the stop, or None.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Begin a new motion."""
        self.spun_rad = 0.0
        self.told_rad: float | None = None
        self._may_be_recorded = False

    def forget(self) -> None:
        """Accept no record of the turn before, because a new odometry frame has begun."""
        self._may_be_recorded = False

    def add(self, turn_rad: float) -> float:
        """Add a turn measured at the wheel; return the part of it that the pose lacks.

        The pose lacks no part if the server has already reported the whole turn.
        """
        self.spun_rad += turn_rad
        return turn_rad if self.told_rad is None else 0.0

    def tell(self, told_rad: float) -> float:
        """Process the angle in the reply to the stop; return the correction."""
        self.told_rad = told_rad
        return told_rad - self.spun_rad

    def end(self, *, may_be_recorded: bool) -> float:
        """End the turn after its last count; return the correction.

        If the reported angle differs too much from the turn measured at the wheel, the correction
        replaces it by the measured turn, and ``told_rad`` becomes None.

        ``may_be_recorded``: whether the server may have recorded this turn.
        """
        self._may_be_recorded = may_be_recorded
        if self.told_rad is None:
            return NO_CORRECTION
        wrong_rad = self.spun_rad - self.told_rad
        if not is_of_another(wrong_rad, self.spun_rad):
            return NO_CORRECTION
        self.told_rad = None
        return wrong_rad

    def record(self, told_rad: float) -> float | None:
        """Process the recorded angle of a turn that has ended; return the correction.

        Return None in two cases: the angle differs too much from the turn measured at the wheel, or
        the turn was not the last motion in this odometry frame.
        """
        wrong_rad = told_rad - self.spun_rad
        if not self._may_be_recorded or is_of_another(wrong_rad, self.spun_rad):
            return None
        self._may_be_recorded = False
        self.spun_rad = told_rad
        return wrong_rad


def is_of_another(wrong_rad: float, spun_rad: float) -> bool:
    """Return whether a reported turn that is wrong by ``wrong_rad`` belongs to another motion.

    ``spun_rad``: the turn that the wheel has measured.
    """
    return abs(wrong_rad) > TOLD_RAD + TOLD_PART * abs(spun_rad)
