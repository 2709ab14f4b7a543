# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Launch file that publishes the robot's description and fixed frames; it can also start RViz.

The launch argument ``frame_prefix`` is put before the names of frames, but not of joints.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import (
    Command,
    FindExecutable,
    LaunchConfiguration,
    PathJoinSubstitution,
    PythonExpression,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the launch description: robot_state_publisher, RViz, and the launch arguments."""
    board = PythonExpression(["'", LaunchConfiguration("board"), "' or 'omnibot'"])
    description = Command(
        [
            FindExecutable(name="xacro"),
            " ",
            PathJoinSubstitution([FindPackageShare("omnibot_driver"), "urdf", board]),
            ".urdf.xacro ",
            LaunchConfiguration("xacro_args"),
        ]
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "board",
                default_value="",
                description="Motor board of the robot to describe. If empty, the board is omnibot.",
            ),
            DeclareLaunchArgument(
                "namespace",
                default_value="",
                description="Namespace of robot_description and joint_states. If empty, these"
                " topics are in no namespace.",
            ),
            DeclareLaunchArgument(
                "frame_prefix",
                default_value="",
                description="Prefix of every frame name, with its slash, such as robot1/",
            ),
            DeclareLaunchArgument(
                "xacro_args",
                default_value="",
                description="xacro arguments for the properties in which this robot differs from"
                " the default, such as base_height:=0.13 imu_rpy:='3.14159 0 1.5708'.",
            ),
            DeclareLaunchArgument(
                "rviz", default_value="false", description="Show the robot in RViz."
            ),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    {
                        "robot_description": ParameterValue(description, value_type=str),
                        "frame_prefix": ParameterValue(
                            LaunchConfiguration("frame_prefix"), value_type=str
                        ),
                    }
                ],
                output="screen",
            ),
            Node(
                condition=IfCondition(LaunchConfiguration("rviz")),
                package="rviz2",
                executable="rviz2",
                namespace=LaunchConfiguration("namespace"),
                arguments=[
                    "--display-config",
                    [
                        PathJoinSubstitution(
                            [
                                FindPackageShare("omnibot_driver"),
                                "rviz",
                                board,
                            ]
                        ),
                        ".rviz",
                    ],
                    "--fixed-frame",
                    [LaunchConfiguration("frame_prefix"), "odom"],
                ],
                output="screen",
            ),
        ]
    )
