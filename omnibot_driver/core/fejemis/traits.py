# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The constant properties of a Fejemis, and advice for a robot that does not obey."""

from typing import Final

from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.motion_monitor.monitor import Fault
from omnibot_driver.core.requests import Request
from omnibot_driver.core.traits import Traits

TRAITS: Final = Traits(
    channels=("drive", "front"),
    imu_period_s=0.01,
    authorities=frozenset({Authority.BASE}),
    requests=frozenset({Request.START, Request.PAUSE}),
    wheels=("left", "right"),
    unheard_s=0.5,
    silence_s=1.5,
    baudrate=False,
    calibrates_gyro=True,
    slack_mps=0.03,
    slack_radps=0.15,
    advice={
        Fault.WRONG_WAY: "check the wiring of the wheels and the encoders",
        Fault.WRONG_TURN: "check `front_wheel_inverted`, `front_wheel_offset` and the wiring",
        Fault.TOO_FAST: "check wheel radius, gear and encoder ticks on the drive board",
        Fault.TURNS_TOO_FAST: "check the steering geometry on both boards",
        Fault.BEYOND_LIMITS: "check wheel radius, gear and encoder ticks on the drive board",
        Fault.BLOCKED: "check motor power and the front wheel, and whether the wheels are blocked",
    },
)
