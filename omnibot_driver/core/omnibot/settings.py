# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The settings of an OmniBot board that the board's data does not show; the user knows them."""

from dataclasses import dataclass, field
from typing import Literal

from omnibot_driver.core.imu.scale import ImuScale
from omnibot_driver.core.omnibot.frames import ByteOrder


@dataclass(frozen=True, slots=True, kw_only=True)
class OmniBotSettings:
    """Facts about a board that its data does not show.

    ``baudrate``: in bits per second, with ten bits per byte; ``linear_scale``: LSB per m/s;
    ``angular_scale``: LSB per rad/s; ``position_scale`` and ``heading_scale``: LSB per m and rad of
    a commanded pose; ``delta_frame``: what deltas are: differences of positions in the board's
    earth frame, motion along the board's own axes, or (older firmware) encoder counts of the wheels
    A, B, C; ``delta_period_s``: time between two deltas in s, one of ``schedule.DELTA_PERIODS_S``,
    constant as long as the ``OmniBot`` exists.
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
