# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The parameters of the driver's work, whatever the board: the line, commands, frames.

Which of them a board has is in ``table``. Knows no ROS.
"""

from typing import Final

from omnibot_driver.parameters.parameter import Parameter

BOARD: Final = Parameter(
    "board",
    "",
    "",
    "The motor board at the other end of the line.",
    fixed=True,
)
"""Its default and only choice are the board whose table it is in."""

LINE: Final = (
    Parameter(
        "port",
        "/dev/ttyUSB0",
        "",
        "Serial device, or any pyserial URL such as socket://host:port; sim:// is a simulated board"
        " inside the driver, replay://bag a recorded wire.",
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
        "Start the board whenever it is there and not running.",
        fixed=True,
    ),
    Parameter(
        "on_exit",
        "stop",
        "",
        "What the board is left in when the driver ends; the robot is stopped in any case.",
        choices=("stop", "pause", "reset"),
    ),
    Parameter(
        "reconnect_interval",
        0.5,
        "s",
        "Time until a lost port is opened again; it grows by half with each failure, to 2 s.",
        low=0.05,
        high=60.0,
    ),
    Parameter(
        "guard",
        True,
        "",
        "Have a small process of its own stop the robot when the driver is killed or hangs.",
        fixed=True,
    ),
    Parameter(
        "publish_raw",
        False,
        "",
        "Publish what every read and every write of the port brought, on ~/raw_rx and ~/raw_tx: a"
        " bag then holds the wire itself, and replay:// plays it.",
        fixed=True,
    ),
)

COMMANDS: Final = (
    Parameter(
        "enable_stamped_cmd_vel",
        False,
        "",
        "Take geometry_msgs/TwistStamped on cmd_vel instead of geometry_msgs/Twist.",
        fixed=True,
    ),
    Parameter(
        "max_linear_speed",
        0.5,
        "m/s",
        "Longest linear velocity that is commanded; longer ones keep their direction.",
        low=0.0,
        high=10.0,
    ),
    Parameter(
        "max_angular_speed",
        0.5,
        "rad/s",
        "Largest yaw rate that is commanded.",
        low=0.0,
        high=10.0,
    ),
    Parameter(
        "max_wheel_speed",
        17.0,
        "rad/s",
        "Rate of the fastest wheel that wheel_cmd may command; the others keep their ratio.",
        low=0.0,
        high=200.0,
    ),
    Parameter(
        "max_linear_acceleration",
        0.0,
        "m/s²",
        "How fast cmd_vel may change the linear velocity, as a vector; 0 is at once. A command to"
        " stand still, or to single wheels, is never slowed.",
        low=0.0,
        high=100.0,
    ),
    Parameter(
        "max_angular_acceleration",
        0.0,
        "rad/s²",
        "The same for the yaw rate.",
        low=0.0,
        high=1000.0,
    ),
    Parameter(
        "cmd_vel_timeout",
        0.5,
        "s",
        "Age at which a velocity command expires; the robot is then stopped.",
        low=0.05,
        high=10.0,
    ),
    Parameter(
        "command_rate",
        20.0,
        "Hz",
        "How often the current command is repeated; Stop and the emergency stop at 20 Hz at least.",
        low=1.0,
        high=50.0,
    ),
    Parameter(
        "motion_monitor",
        True,
        "",
        "Stop a robot that moves otherwise than commanded, and refuse motion; off, it drives on.",
    ),
)

FRAMES: Final = (
    Parameter("odom_frame", "odom", "", "Frame that the odometry is given in.", fixed=True),
    Parameter("base_frame", "base_link", "", "Frame that the odometry moves.", fixed=True),
    Parameter("imu_frame", "imu_link", "", "Frame of the IMU's axes.", fixed=True),
    Parameter(
        "frame_prefix",
        "",
        "",
        "Text put before every frame name, without adding a slash, like robot_state_publisher's;"
        " for example robot1/.",
        fixed=True,
    ),
    Parameter(
        "publish_tf",
        True,
        "",
        "Publish the transform from odom_frame to base_frame on /tf; false with an EKF that does.",
        fixed=True,
    ),
)
