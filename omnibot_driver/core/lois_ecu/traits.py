# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Capabilities of a LOIS ECU, and advice on what to check when the robot does not obey."""

from typing import Final

from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.motion_monitor.monitor import Fault
from omnibot_driver.core.requests import Request
from omnibot_driver.core.traits import Traits

STANDS_AFTER_S: Final = 0.6
"""Time in s without a tick after which a wheel is regarded as at rest. At the lowest speed, 2 RPM,
a tick comes every 0.5 s."""
TRAITS: Final = Traits(
    imu_period_s=None,
    authorities=frozenset({Authority.BASE, Authority.WHEELS}),
    requests=frozenset({Request.RESET}),
    wheels=("left", "right"),
    unheard_s=1.0,  # groups come every 0.2 or 0.4 s, and may be lost
    silence_s=1.5,
    own_odometry=True,
    stands_after_s=STANDS_AFTER_S,
    slack_mps=0.15,  # a tick in 0.2 s is 0.07 m/s
    slack_radps=1.2,  # with the board's own gains, one wheel accelerates faster than the other
    advice={
        Fault.WRONG_WAY: "check `inverted`, and the wiring of motors and encoders",
        Fault.WRONG_TURN: "check `inverted`, and the wiring of motors and encoders",
        Fault.TOO_FAST: (
            "check `wheel_radius` and `ticks_per_revolution`; in duty mode, `duty_scale`"
        ),
        Fault.TURNS_TOO_FAST: (
            "check `track`, `wheel_radius` and `ticks_per_revolution`; in duty mode, `duty_scale`"
        ),
        Fault.BEYOND_LIMITS: (
            "check `wheel_radius`, `track` and `ticks_per_revolution`; in duty mode, `duty_scale`"
        ),
        Fault.BLOCKED: (
            "check motor power, and whether the wheels are blocked; check `low_pass` and the gains"
            " that were set, or in duty mode `duty_scale`"
        ),
        Fault.HELD_BY_ESTOP: (
            "check motor power, and whether the e-stop button is held. The board reports each"
            " press and each release only once, so the driver can miss one"
        ),
    },
)
