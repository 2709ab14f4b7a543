"""Starts a simulated board and the driver on it; takes the arguments of driver.launch.py."""

import tempfile
import uuid
from pathlib import Path

from launch import LaunchDescription
from launch.actions import ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return board and driver, joined by a link that no other launch has."""
    link = str(Path(tempfile.gettempdir(), f"omnibot_sim_{uuid.uuid4().hex[:12]}"))
    return LaunchDescription(
        [
            # Not a Node: launch_ros would append ROS arguments, and the board knows no ROS.
            ExecuteProcess(
                cmd=[ExecutableInPackage("simulator", "omnibot_driver"), "--link", link],
                name="simulator",
                output="screen",
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(
                    PathJoinSubstitution(
                        [FindPackageShare("omnibot_driver"), "launch", "driver.launch.py"]
                    )
                ),
                launch_arguments={"port": link}.items(),
            ),
        ]
    )
