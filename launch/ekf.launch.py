# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Launch file that starts the driver, the description and robot_localization's filter.

The filter publishes the transform from odom to base_link, so the driver does not. The filter needs
the description, because the description says how the sensors are mounted.
"""

from pathlib import Path
from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from omnibot_driver.boards import PROFILES

CONFIG = Path(__file__).parents[1] / "config"
FILTERED = [name for name in PROFILES if (CONFIG / f"ekf_{name}.yaml").is_file()]
FRAMES = {
    "map_frame": "map",
    "odom_frame": "odom",
    "world_frame": "odom",
    "base_link_frame": "base_link",
}


def include(name: str, arguments: dict[str, Any]) -> IncludeLaunchDescription:
    """Return an action that includes the launch file ``name`` of this package.

    ``arguments``: values of launch arguments, by name.
    """
    path = PathJoinSubstitution([FindPackageShare("omnibot_driver"), "launch", name])
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(path), launch_arguments=arguments.items()
    )


def generate_launch_description() -> LaunchDescription:
    """Return the launch description: driver, description, filter, and the launch arguments."""
    prefix = LaunchConfiguration("frame_prefix")
    frames = {
        parameter: ParameterValue([prefix, frame], value_type=str)
        for parameter, frame in FRAMES.items()
    }
    board = PythonExpression(["'", LaunchConfiguration("board"), "' or 'omnibot'"])
    file = PythonExpression(
        ["'ekf.yaml' if '", board, "' == 'omnibot' else 'ekf_", board, ".yaml'"]
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "board",
                default_value="",
                choices=["", "omnibot", *FILTERED],
                description="Motor board of the robot. If empty, the filter and the description"
                " are for omnibot, and the driver takes its board from params_file.",
            ),
            DeclareLaunchArgument(
                "ekf_params_file",
                default_value=PathJoinSubstitution(
                    [FindPackageShare("omnibot_driver"), "config", file]
                ),
                description="YAML file with the filter's parameters. Frame names in the file have"
                " no effect, because this launch file sets them.",
            ),
            include("driver.launch.py", {"publish_tf": "false"}),
            include("description.launch.py", {"board": board}),
            Node(
                package="robot_localization",
                executable="ekf_node",
                name="ekf_filter_node",
                namespace=LaunchConfiguration("namespace"),
                parameters=[LaunchConfiguration("ekf_params_file"), frames],
                output="screen",
            ),
        ]
    )
