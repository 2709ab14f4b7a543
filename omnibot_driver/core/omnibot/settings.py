# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The settings of an OmniBot board: facts that the user knows and the board does not send."""

from dataclasses import dataclass, field
from typing import Literal

from omnibot_driver.core.imu.scale import ImuScale
from omnibot_driver.core.omnibot.frames import ByteOrder


@dataclass(frozen=True, slots=True, kw_only=True)
class OmniBotSettings:
    """Facts about a board that its data does not show.

    * ``linear_scale``, ``angular_scale``: LSB per m/s and per rad/s of a commanded velocity.
    * ``position_scale``, ``heading_scale``: LSB per m and per rad of a commanded pose.
    * ``delta_frame``: axes of the deltas, "earth" or "body"; "wheel_counts" if the deltas contain
      encoder counts (older firmware).
    * ``delta_period_s``: one of ``schedule.DELTA_PERIODS_S``; constant while the ``OmniBot``
      exists.
    """

    baudrate: int = 115200
    linear_scale: float = 70.0
    angular_scale: float = 500.0
    position_scale: float = 1000.0
    heading_scale: float = 1000.0
    wheel_radius_m: float = 0.029
    base_radius_m: float = 0.143
    counts_per_revolution: int = 1560
    delta_frame: Literal["earth", "body", "wheel_counts"] = "earth"
    delta_period_s: float = 0.04
    pose_byte_order: ByteOrder = "big"
    imu: ImuScale = field(default_factory=ImuScale)
