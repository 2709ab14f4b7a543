# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Converts an order into motion lines for both boards, depending on the front wheel's angle.

The caller sends the packets from ``Encoder.encode``, and then passes them to ``Encoder.meaning``.
"""

from typing import Protocol

from omnibot_driver.core.commands.orders import Drive, EmergencyStop, GoTo, Order, TurnWheels
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.fejemis.follower import FOLLOWS_RAD, Follower
from omnibot_driver.core.fejemis.motion_lines import (
    LEAST_MPS,
    drive_line,
    front_line,
    plain_drive_line,
    plain_front_line,
)
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.steering import (
    ACROSS_RAD,
    ALIGNED_RAD,
    AT_REST,
    Geometry,
    Steered,
    outer_mps,
    steer,
)
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import Packets

REVERSE = (
    "cmd_vel: a negative speed is set to zero, because `allow_reverse` is false; read"
    " docs/boards/fejemis.md before you set it to true"
)


class Pair(Protocol):
    """The two boards of the robot, with the properties and methods that ``Encoder`` needs."""

    @property
    def geometry(self) -> Geometry:
        """Track B and wheelbase F of the robot, in m."""

    @property
    def front_angle_rad(self) -> float | None:
        """Angle of the front wheel in rad, or None while it is unknown."""

    def stop(self) -> Packets:
        """Return the packets that stop the motion."""

    def emergency_stop(self) -> Packets:
        """Return the packets of the boards' own emergency stop."""

    def motion(self, drive: bytes, front: bytes) -> Packets:
        """Return the packets that send one motion line to each of the two boards.

        ``drive``: the line for the drive board. ``front``: the line for the front board.
        """

    @property
    def with_sums(self) -> bool:
        """Whether the text lines to both boards carry checksums."""

    def remark(self, text: str) -> None:
        """Queue a notice for the user that is shown only once."""


class Encoder:
    """Converts each motion order into packets for both boards.

    ``held``: whether the speed is limited because the front wheel has not reached its angle.
    """

    def __init__(self, pair: Pair, settings: FejemisSettings) -> None:
        self.settings = settings
        self._pair = pair
        self.follower = Follower()
        self.begin()

    def begin(self) -> None:
        """Forget the last order. Until the next order, no motion is commanded."""
        self.held = self._turning = False
        self._encoded: tuple[Packets, Steered] | None = None
        self.follower.begin()

    @property
    def restless(self) -> bool:
        """Whether to send the motion lines again after each new angle of the front wheel.

        True if this angle limits the speed, or if the lines have no checksums, so that damage may
        be unnoticed.
        """
        return self.held or not self._pair.with_sums

    def stop(self) -> Packets:
        """Return the packets that stop both boards."""
        return self._pair.stop()

    def emergency_stop(self) -> Packets:
        """Return the packets of the boards' own emergency stop."""
        return self._pair.emergency_stop()

    def encode(self, order: Order) -> Packets:
        """Return the lines for ``order``. Raises CommandRefused if the robot cannot obey it."""
        match order:
            case Drive(twist):
                return self._drive(twist)
            case TurnWheels() | GoTo():
                raise CommandRefused("command rejected: this board accepts only cmd_vel")
            case EmergencyStop():
                return self.emergency_stop()
        return self.stop()

    def meaning(self, packets: Packets) -> BodyTwist:
        """Return the twist that the sent ``packets`` give to the robot's body.

        Only the first call after ``encode``, with the returned packets, gives a motion. Any other
        call returns a standstill.
        """
        encoded, self._encoded = self._encoded, None
        if encoded is None or encoded[0] != packets:
            self.held = self._turning = False
            return AT_REST
        _, steered = encoded
        waits = steered.part == 0.0  # until the wheel is near enough for a turn on the spot
        self.follower.aim(steered.angle_rad, ALIGNED_RAD if waits else FOLLOWS_RAD)
        self.held = steered.part != 1.0
        self._turning = abs(steered.angle_rad) >= ACROSS_RAD and steered.part > 0.0
        return steered.twist

    def _drive(self, twist: BodyTwist) -> Packets:
        pair = self._pair
        geometry = pair.geometry
        speed_mps = twist.vx_mps if abs(twist.vx_mps) >= LEAST_MPS else 0.0
        if speed_mps < 0.0 and not self.settings.allow_reverse:
            pair.remark(REVERSE)
            speed_mps = 0.0
        wanted = BodyTwist(speed_mps, 0.0, twist.yaw_rate_radps)
        if outer_mps(wanted, geometry.track_m) < LEAST_MPS:
            return pair.stop()
        steered = steer(wanted, geometry, pair.front_angle_rad, turning=self._turning)
        speed, turn = steered.speed_mps, steered.turn_radps
        if pair.with_sums:
            front = front_line(speed, turn, geometry.wheelbase_m)
            drive = drive_line(steered.part * speed, steered.part * turn)
        else:
            front = plain_front_line(speed, turn)
            drive = plain_drive_line(steered.part * speed, steered.part * turn)
        packets = pair.motion(drive, front)
        self._encoded = packets, steered
        return packets
