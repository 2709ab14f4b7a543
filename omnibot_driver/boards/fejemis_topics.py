# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Topics and services that only a Fejemis has. This module only connects ROS to the session."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import rclpy
from geometry_msgs.msg import Quaternion, Vector3
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import BatteryState, Imu, JointState, MagneticField, Range
from std_msgs.msg import Header

from omnibot_driver import declaration, messages
from omnibot_driver.boards.fejemis_command_topics import FejemisCommands
from omnibot_driver.core.fejemis import (
    BatteryReading,
    MagneticReading,
    OrientedImuReading,
    RangeReading,
    SteeringReading,
)
from omnibot_driver.core.geometry.steered import SteeredKinematics

NAN: Final = float("nan")
STEERING_EVERY_NS: Final = 40_000_000
"""Shortest time between two published steering angles, in ns.

The board sends 66 angles per second; an angle that comes earlier is not published.
"""
RANGES: Final = ("tof", "sonar", "ir1", "ir2")


class FejemisTopics:
    """The topics and services that only a Fejemis has.

    ``publish``: a mapping from each type of reading to the method that publishes it.
    """

    def __init__(self, node: Node, link: Any, values: Mapping[str, Any]) -> None:
        self._values = values
        self._prefix = values["frame_prefix"]
        self._steering = _publisher_of(node, "joint_states")
        self._imu = node.create_publisher(Imu, "imu/data", 10)
        self._mag = node.create_publisher(MagneticField, "imu/mag", 10)
        self._battery = node.create_publisher(BatteryState, "battery_state", 10)
        self._ranges = {name: node.create_publisher(Range, f"range/{name}", 10) for name in RANGES}
        self._steered_ns = 0
        self.publish: dict[type, Callable[[Any, int], None]] = {
            SteeringReading: self._publish_steering,
            OrientedImuReading: self._publish_imu,
            MagneticReading: self._publish_mag,
            BatteryReading: self._publish_battery,
            RangeReading: self._publish_range,
        }
        self._commands = FejemisCommands(node, link, values)
        self.publish |= self._commands.publish
        node.add_post_set_parameters_callback(self._apply)

    def _apply(self, changed: list[rclpy.Parameter]) -> None:
        self._values = self._commands.values = declaration.updated(self._values, changed)

    def _header(self, stamp_ns: int, frame: str = "") -> Header:
        frame_id = self._prefix + frame if frame else ""
        return Header(stamp=messages.time_message(stamp_ns), frame_id=frame_id)

    def _publish_steering(self, steering: SteeringReading, stamp_ns: int) -> None:
        if 0 <= stamp_ns - self._steered_ns < STEERING_EVERY_NS:
            return
        self._steered_ns = stamp_ns
        self._steering.publish(
            JointState(
                header=self._header(stamp_ns),
                name=[SteeredKinematics.steering_joint],
                position=[steering.angle_rad],
            )
        )

    def _publish_imu(self, imu: OrientedImuReading, stamp_ns: int) -> None:
        x, y, z, w = imu.orientation
        roll, pitch, yaw = (stddev**2 for stddev in self._values["orientation_stddev"])
        self._imu.publish(
            Imu(
                header=self._header(stamp_ns, self._values["imu_frame"]),
                orientation=Quaternion(x=x, y=y, z=z, w=w),
                orientation_covariance=[roll, 0.0, 0.0, 0.0, pitch, 0.0, 0.0, 0.0, yaw],
                angular_velocity=_vector(imu.angular_velocity),
                angular_velocity_covariance=messages.isotropic(
                    self._values["angular_velocity_stddev"]
                ),
                linear_acceleration=_vector(imu.specific_force),
                linear_acceleration_covariance=messages.isotropic(
                    self._values["linear_acceleration_stddev"]
                ),
            )
        )

    def _publish_mag(self, mag: MagneticReading, stamp_ns: int) -> None:
        self._mag.publish(
            MagneticField(
                header=self._header(stamp_ns, self._values["imu_frame"]),
                magnetic_field=_vector(mag.field_t),
                magnetic_field_covariance=messages.isotropic(self._values["magnetic_field_stddev"]),
            )
        )

    def _publish_battery(self, battery: BatteryReading, stamp_ns: int) -> None:
        status = BatteryState.POWER_SUPPLY_STATUS_UNKNOWN
        if battery.amps < 0.0:
            status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        self._battery.publish(
            BatteryState(
                header=self._header(stamp_ns),
                voltage=battery.volts,
                temperature=NAN,
                current=battery.amps,
                charge=NAN,
                capacity=NAN,
                design_capacity=NAN,
                percentage=NAN,
                power_supply_status=status,
                power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
                power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
                present=True,
                cell_voltage=[NAN] * battery.cells,
            )
        )

    def _publish_range(self, reading: RangeReading, stamp_ns: int) -> None:
        kind = reading.name.rstrip("12")
        nearest, farthest = self._values[f"{kind}_minimum"], self._values[f"{kind}_maximum"]
        seen = 0.0 < reading.distance_m <= farthest
        self._ranges[reading.name].publish(
            Range(
                header=self._header(stamp_ns, f"range_{reading.name}_link"),
                radiation_type=messages.RADIATION[self._values[f"{kind}_type"]],
                field_of_view=self._values[f"{kind}_field_of_view"],
                min_range=nearest,
                max_range=farthest,
                range=reading.distance_m if seen else math.inf,
            )
        )


def _publisher_of(node: Node, topic: str) -> Publisher:
    """Return the publisher of a topic that every board has. The driver has already created it."""
    name = node.resolve_topic_name(topic)
    return next(one for one in node.publishers if one.topic_name == name)


def _vector(parts: tuple[float, float, float]) -> Vector3:
    x, y, z = parts
    return Vector3(x=x, y=y, z=z)
