# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The LOIS ECU in the fault campaign: lines of text, two wheels, no IMU.

Published messages are not compared with the board's reports, because the driver predicts odometry.
"""

from typing import Final

from rig_board import RigBoard

from omnibot_driver.simulator.lois_ecu import LoisSettings, SimulatedLois

STOP: Final = b":01000000003b\n"


def make(settings: LoisSettings | None) -> SimulatedLois:
    return SimulatedLois(settings or LoisSettings(running=True))


BOARD: Final = RigBoard(
    name="lois_ecu",
    make=make,
    parameters={"board": "lois_ecu"},
    old_command=b":020014001438\n",  # RPM 20/20
    stop=STOP,
    opening=STOP,
    wheels=2,
    services=frozenset({"reset", "reset_odometry", "estop"}),
    tuning=(
        "max_linear_speed",
        "max_angular_speed",
        "max_wheel_speed",
        "max_linear_acceleration",
        "cmd_vel_timeout",
        "command_rate",
        "reconnect_interval",
    ),
    off_within_s=0.1,  # the motors obey at control interrupts, 91 ms apart
    old_bytes_s=1.8,  # 20 kB at 115200 baud, received byte by byte
    ends_later_s=1.5,  # a standstill shows after 0.6 s; the driver waits for it twice
    deaf_s=0.6,  # commands are lost while the board sends; a lost port is open again after 0.5 s
    silent_s=0.2,  # the pause between two groups of reports
    imu=False,
    jump_stddevs=4.0,
    without=frozenset(
        {
            "~/pause with true, then false",
            "e-stop into a full port",  # it checks frames of the OmniBot
            "faults_of_goals",
            "goal_ending",
            "random_input",
            "walk",
            "walk_with_goals",
            "busy_computer",
        }
    ),
)
