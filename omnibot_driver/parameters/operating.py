# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Common parameters of the driver's operation: the line, commands, frames.

The module ``table`` selects the parameters that a board has. This module does not use ROS.
"""

from typing import Final

from omnibot_driver.parameters.parameter import Parameter

BOARD: Final = Parameter(
    "board",
    "",
    "",
    "Kind of motor board that the driver controls.",
    fixed=True,
)
"""Parameter that names the board. In the table of a board, the board's name is the default and the
only choice."""

LINE: Final = (
    Parameter(
        "port",
        "/dev/ttyUSB0",
        "",
        "Serial device, or any pyserial URL such as socket://host:port; sim:// is a simulated"
        " board inside the driver, and replay://bag plays a recorded bag.",
        fixed=True,
    ),
    Parameter(
        "baudrate",
        115200,
        "baud",
        "Speed of the serial line.",
        low=1200,
        high=4_000_000,
        fixed=True,
    ),
    Parameter(
        "auto_start",
        True,
        "",
        "Start the board whenever it is connected and does not run.",
        fixed=True,
    ),
    Parameter(
        "on_exit",
        "stop",
        "",
        "State in which the driver leaves the board when it ends. The robot is stopped in any"
        " case.",
        choices=("stop", "pause", "reset"),
    ),
    Parameter(
        "reconnect_interval",
        0.5,
        "s",
        "Time until the driver tries to open a lost port again. After each failure, the driver"
        " waits 1.5 times as long, up to 2 s. With a value above 2 s, the wait is always the same.",
        low=0.05,
        high=60.0,
    ),
    Parameter(
        "guard",
        True,
        "",
        "Run a guard process that stops the robot when the driver is killed or hangs.",
        fixed=True,
    ),
    Parameter(
        "publish_raw",
        False,
        "",
        "Publish the bytes of every read and write of the port on ~/raw_rx and ~/raw_tx. replay://"
        " plays a bag of these topics.",
        fixed=True,
    ),
)

COMMANDS: Final = (
    Parameter(
        "enable_stamped_cmd_vel",
        False,
        "",
        "Subscribe to cmd_vel as geometry_msgs/TwistStamped instead of geometry_msgs/Twist.",
        fixed=True,
    ),
    Parameter(
        "max_linear_speed",
        0.5,
        "m/s",
        "Largest linear speed that the driver commands. A faster command is slowed down and keeps"
        " its direction.",
        low=0.0,
        high=10.0,
    ),
    Parameter(
        "max_angular_speed",
        0.5,
        "rad/s",
        "Largest yaw rate that the driver commands.",
        low=0.0,
        high=10.0,
    ),
    Parameter(
        "max_wheel_speed",
        17.0,
        "rad/s",
        "Largest wheel rate that the driver commands for wheel_cmd. If one wheel exceeds it, all"
        " wheels are slowed down in the same ratio.",
        low=0.0,
        high=200.0,
    ),
    Parameter(
        "max_linear_acceleration",
        0.0,
        "m/s²",
        "Largest linear acceleration (length of the vector) that the driver commands for cmd_vel."
        " 0 turns the limit off. The limit does not apply to a zero command (stop) or to"
        " wheel_cmd.",
        low=0.0,
        high=100.0,
    ),
    Parameter(
        "max_angular_acceleration",
        0.0,
        "rad/s²",
        "Largest acceleration with which cmd_vel changes the yaw rate. 0 turns the limit off.",
        low=0.0,
        high=1000.0,
    ),
    Parameter(
        "cmd_vel_timeout",
        0.5,
        "s",
        "Age at which a velocity command expires. The driver then stops the robot.",
        low=0.05,
        high=10.0,
    ),
    Parameter(
        "command_rate",
        20.0,
        "Hz",
        "How often the current command is repeated. Stop and the emergency stop are repeated at 20"
        " Hz at least.",
        low=1.0,
        high=50.0,
    ),
    Parameter(
        "motion_monitor",
        True,
        "",
        "Stop a robot that does not move as commanded, and refuse motion afterwards.",
    ),
)

FRAMES: Final = (
    Parameter("odom_frame", "odom", "", "Frame of the odometry.", fixed=True),
    Parameter(
        "base_frame",
        "base_link",
        "",
        "Frame of the robot's base; the odometry gives its pose in odom_frame.",
        fixed=True,
    ),
    Parameter("imu_frame", "imu_link", "", "Frame of the IMU's axes.", fixed=True),
    Parameter(
        "frame_prefix",
        "",
        "",
        "Prefix of every frame name, including the slash, such as robot1/. The parameter"
        " frame_prefix of robot_state_publisher works in the same way.",
        fixed=True,
    ),
    Parameter(
        "publish_tf",
        True,
        "",
        "Publish the transform from odom_frame to base_frame on /tf. Set publish_tf to false"
        " if an EKF publishes this transform.",
        fixed=True,
    ),
)
