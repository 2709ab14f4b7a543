# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Initial parameters of the wheels' controllers and encoders, and the commands that change them.

This module does not know the text lines of the commands.
"""

from omnibot_driver.simulator.lois_ecu.channel import WheelChannel
from omnibot_driver.simulator.lois_ecu.motors import Gains
from omnibot_driver.simulator.lois_ecu.settings import Quirks

LEFT_GAINS = Gains(kp=0.4412, tn=0.2865, td=0.6495)
RIGHT_GAINS = Gains(kp=0.7316, tn=0.1383, td=0.6495)
CORRECTIONS = ((1.0761719, 0.9338983), (1.0954246, 0.9198685))
GAIN_NAMES = {0x06: "kp", 0x07: "tn", 0x08: "td", 0x09: "kp", 0x0A: "tn", 0x0B: "td"}


def wheels_of(quirks: Quirks, steps: int) -> tuple[WheelChannel, ...]:
    """Return the left and the right wheel as they are after a boot."""
    low_pass = 0.0 if quirks.low_pass_starts_at_zero else 1.0
    return tuple(
        WheelChannel(
            quirks, steps, corrections, Gains(gains.kp, gains.tn, gains.td, low_pass=low_pass)
        )
        for corrections, gains in zip(CORRECTIONS, (LEFT_GAINS, RIGHT_GAINS), strict=True)
    )


def adjust(wheels: tuple[WheelChannel, ...], command: int, number: float, quirks: Quirks) -> None:
    """Set the gain or correction that ``command`` writes. Other commands are ignored.

    Feed-forward and low-pass filter (0x21 to 0x23) exist in the public firmware only.
    """
    left, right = wheels
    if command in GAIN_NAMES:
        channel = left if command <= 0x08 else right
        channel.controller.change(**{GAIN_NAMES[command]: number})
    elif command in (0x13, 0x15):
        (left if command == 0x13 else right).short_correction = number
    elif command in (0x14, 0x16):
        (left if command == 0x14 else right).long_correction = number
    elif command in (0x21, 0x22) and quirks.extra_settings:
        (left if command == 0x21 else right).controller.change(feed_forward=number)
    elif command == 0x23 and quirks.extra_settings:
        left.controller.change(low_pass=number)
        right.controller.change(low_pass=number)
