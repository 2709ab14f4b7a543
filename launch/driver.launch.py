"""Starts the driver, with its parameters from a file and, where given, another port."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def driver_node(context: LaunchContext) -> list[Node]:
    """Return the driver; an empty ``port`` leaves the choice to the parameter file."""
    parameters = [LaunchConfiguration("params_file")]
    if port := LaunchConfiguration("port").perform(context):
        parameters.append({"port": ParameterValue(port, value_type=str)})
    return [
        Node(
            package="omnibot_driver",
            executable="driver",
            name="omnibot_driver",
            namespace=LaunchConfiguration("namespace"),
            parameters=parameters,
            output="screen",
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """Return the driver and its arguments."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "port",
                default_value="",
                description="Serial device or pyserial URL of the board; "
                "empty: the port in params_file.",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution(
                    [FindPackageShare("omnibot_driver"), "config", "driver.yaml"]
                ),
                description="YAML file with the driver's parameters.",
            ),
            DeclareLaunchArgument(
                "namespace",
                default_value="",
                description="Namespace of the node and its topics, one per robot; empty: none.",
            ),
            OpaqueFunction(function=driver_node),
        ]
    )
