# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Launch file that starts the driver with a parameter file.

A launch argument has precedence over the same parameter in the file.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from omnibot_driver.boards import PROFILES

OVERRIDES = {
    "board": (str, "Motor board of the robot"),
    "port": (str, "Serial device or pyserial URL of the board"),
    "front_port": (str, "Serial device of the front board, if the robot has one (fejemis)"),
    "publish_tf": (bool, "Whether the driver publishes the transform from odom to base_link"),
    "frame_prefix": (str, "Prefix of every frame name, with its slash, such as robot1/"),
}


def driver_node(context: LaunchContext) -> list[Node]:
    """Return a list with the driver's node.

    If a launch argument is empty, the node uses the value in the parameter file.
    """
    file = LaunchConfiguration("params_file").perform(context)
    if not file:
        board = LaunchConfiguration("board").perform(context) or "omnibot"
        share = FindPackageShare("omnibot_driver")
        file = PathJoinSubstitution([share, "config", f"{board}.yaml"]).perform(context)
    overrides = {
        name: ParameterValue(LaunchConfiguration(name), value_type=type_)
        for name, (type_, _) in OVERRIDES.items()
        if LaunchConfiguration(name).perform(context)
    }
    return [
        Node(
            package="omnibot_driver",
            executable="driver",
            name="omnibot_driver",
            namespace=LaunchConfiguration("namespace"),
            parameters=[file, overrides],
            output="screen",
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """Return the launch description: the driver and the launch arguments."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name,
                    default_value="",
                    choices=["", *PROFILES] if name == "board" else None,
                    description=f"{description}. If empty, the value in params_file is used.",
                )
                for name, (_, description) in OVERRIDES.items()
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value="",
                description="YAML file with the driver's parameters. If empty, the board's file in"
                " this package's config/ is used. If board is empty too, omnibot.yaml is used.",
            ),
            DeclareLaunchArgument(
                "namespace",
                default_value="",
                description="Namespace of the node and its topics. Each of several robots needs a"
                " namespace of its own.",
            ),
            OpaqueFunction(function=driver_node),
        ]
    )
