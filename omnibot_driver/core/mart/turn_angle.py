# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The angle of a turn on the spot: the wheel measures it, and the server reports it.

The server's angle comes from the gyro, and is preferred to the wheel's. This module knows angles in
rad; it does not know the pose.
"""

from typing import Final

TOLD_RAD, TOLD_PART = 0.05, 0.3
"""Largest accepted difference between the reported turn and the turn that the wheel measured.

The difference may be TOLD_RAD (rad), plus TOLD_PART times the turn that the wheel measured.
"""
NO_CORRECTION: Final = 0.0


class TurnAngle:
    """The angle of the current turn on the spot, or of the last one.

    ``spun_rad``: the angle by the right wheel's encoder. If ``record`` accepts the angle in the
    server's file of the turn, this angle replaces it. The methods return corrections in rad, which
    the caller adds to the heading.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Begin a new motion."""
        self.spun_rad = 0.0
        self.told_rad: float | None = None
        self._may_be_recorded = False

    def forget(self) -> None:
        """Reject a record of the last turn that comes later: the odometry frame was reset.

        The heading in the new frame does not include that turn.
        """
        self._may_be_recorded = False

    def add(self, turn_rad: float) -> float:
        """Add a turn that the wheel measured; return the angle that the caller adds to the heading.

        The result is zero once the server has reported the angle of the whole turn (``tell``).
        """
        self.spun_rad += turn_rad
        return turn_rad if self.told_rad is None else 0.0

    def tell(self, told_rad: float) -> float:
        """Process the turn's angle from the server's reply to the stop request.

        Return the correction of the heading.
        """
        self.told_rad = told_rad
        return told_rad - self.spun_rad

    def end(self, *, may_be_recorded: bool) -> float:
        """End the turn after its last encoder count; return the correction of the heading.

        If the server's angle was implausible, the wheel's measurement replaces it.
        ``may_be_recorded``: whether the server may have recorded the turn.
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
        """Process the angle in the record of an ended turn; return the heading's correction.

        Return None in two cases: the recorded angle is implausible, or the turn is not the last
        motion in the current odometry frame.
        """
        wrong_rad = told_rad - self.spun_rad
        if not self._may_be_recorded or is_of_another(wrong_rad, self.spun_rad):
            return None
        self._may_be_recorded = False
        self.spun_rad = told_rad
        return wrong_rad


def is_of_another(wrong_rad: float, spun_rad: float) -> bool:
    """Return whether a reported angle belongs to another motion, not to this turn.

    ``spun_rad``: the turn that the wheel measured. ``wrong_rad``: difference between ``spun_rad``
    and the reported angle.
    """
    return abs(wrong_rad) > TOLD_RAD + TOLD_PART * abs(spun_rad)
