# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Launch file that starts the driver with a simulated board in the same process.

The launch arguments are those of driver.launch.py.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the launch description: a driver with a simulated board, and the argument ``port``."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "port",
                default_value="sim://",
                description="URL of a simulated board with its options, such as"
                " sim://?imu_only&seed=1",
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(
                    PathJoinSubstitution(
                        [FindPackageShare("omnibot_driver"), "launch", "driver.launch.py"]
                    )
                ),
                launch_arguments={"port": LaunchConfiguration("port")}.items(),
            ),
        ]
    )
