# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Programs that relay a board's data, each with one task more than the previous one.

Even the last program has fewer tasks than the driver. Arguments: a key of STEPS, the port, the
namespace. Nothing is written to the port.
"""

import os
import select
import sys
import termios
import threading
import time
from collections.abc import Callable
from typing import Final

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

from omnibot_driver import boards, parameters
from omnibot_driver.boards import omnibot
from omnibot_driver.cdr import Serializer
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.omnibot import DeltaFrame, FrameDecoder, ImuFrame
from omnibot_driver.core.session import Session
from omnibot_driver.messages import MessageSettings, turned, unturned

LENGTHS = {0xFA: 14, 0xFB: 9, 0xFC: 15}
MPS2_PER_COUNT = 9.80665 / 16384
AT_REST = (Pose(), BodyTwist(0.0, 0.0, 0.0), Covariance(), Pose(), BodyTwist(0.0, 0.0, 0.0))
Estimates = list[ImuEstimate | OdometryEstimate]


class Relay:
    """A relay that publishes a board's data as messages.

    Each step in ``STEPS`` relays the bytes of a read by one of the methods ``trust``, ``decode``
    and ``measure``.
    """

    def __init__(self, node: Node) -> None:
        values = boards.check_all({})
        settings = MessageSettings.from_parameters(values, omnibot.kinematics(values))
        self._make, self._wheels, self._sizes = (
            Serializer(settings),
            unturned(settings.wheels),
            settings.wheels,
        )
        self._imus = node.create_publisher(Imu, "imu/data_raw", 10)
        self._odometries = node.create_publisher(Odometry, "odom", 10)
        self._joints = node.create_publisher(JointState, "joint_states", 10)
        self._decoder = FrameDecoder()
        self._session = Session(
            omnibot.make(values),
            parameters.session_settings(values, omnibot.kinematics(values)),
            run=True,
        )
        self._session.opened(time.monotonic())
        self._begun = b""

    def publish(self, estimates: Estimates) -> None:
        """Publish each estimate as a message on its topic, with the timestamp of the estimate."""
        for estimate in estimates:
            stamp_ns = round(1e9 * estimate.stamp_s)
            if isinstance(estimate, ImuEstimate):
                self._imus.publish(self._make.imu(estimate, stamp_ns))
            else:
                self._odometries.publish(self._make.odometry(estimate, stamp_ns))
                self._wheels = turned(self._wheels, estimate, self._sizes)
                self._joints.publish(self._make.joint_state(self._wheels, stamp_ns))

    def trust(self, data: bytes) -> None:
        """Publish messages for each group of bytes that looks like an IMU or delta frame.

        Nothing is checked, and only the first number of an IMU frame is decoded.
        """
        estimates: Estimates = []
        at, data = 0, self._begun + data
        while at + 1 < len(data) and at + LENGTHS.get(kind := data[at + 1], 1) <= len(data):
            if kind == 0xFA:
                word = int.from_bytes(data[at + 2 : at + 4], "big", signed=True)
                force = (word * MPS2_PER_COUNT, 0.0, 0.0)
                estimates.append(ImuEstimate(0.0, force, (0.0, 0.0, 0.0)))
            elif kind == 0xFB:
                estimates.append(OdometryEstimate(0.0, *AT_REST))
            at += LENGTHS.get(kind, 1)
        self._begun = data[at:]
        self.publish(estimates)

    def decode(self, data: bytes) -> None:
        """Decode and check frames, and publish them."""
        estimates: Estimates = []
        for frame in self._decoder.feed(data, time.monotonic()):
            if isinstance(frame, ImuFrame):
                x, y, z = frame.accel
                force = (x * MPS2_PER_COUNT, y * MPS2_PER_COUNT, z * MPS2_PER_COUNT)
                estimates.append(ImuEstimate(0.0, force, (0.0, 0.0, 0.0)))
            elif isinstance(frame, DeltaFrame):
                estimates.append(OdometryEstimate(0.0, *AT_REST))
        self.publish(estimates)

    def measure(self, data: bytes) -> None:
        """Decode, stamp, check and integrate frames in a session, and publish the estimates."""
        now = time.monotonic()
        self.publish(list(self._session.inbound.hear(data, now)))
        self._session.inbound.process(now)
        self._session.take_output(now)
        told = self._session.take_events()
        self.publish([each for each in told if isinstance(each, OdometryEstimate)])


STEPS: Final[dict[str, tuple[str, Callable[[Relay, bytes], None], bool]]] = {
    "bytes": ("publish bytes, not messages", Relay.trust, False),
    "poll": ("a read that can be ended, and a lock", Relay.trust, True),
    "decode": ("prove the frames", Relay.decode, True),
    "measure": ("stamp, check, integrate, react", Relay.measure, True),
}


def main() -> None:
    """Relay data until the serial line is closed at its other end, or the process is killed."""
    step, path, namespace = sys.argv[1:]
    port = os.open(path, os.O_RDWR | os.O_NOCTTY)
    rclpy.init()
    node = Node("step", namespace=namespace, start_parameter_services=False, enable_rosout=False)
    relay, lock = Relay(node), threading.Lock()
    _, work, polls = STEPS[step]
    arrivals = select.poll()
    arrivals.register(port, select.POLLIN)
    termios.tcflush(port, termios.TCIFLUSH)
    while True:
        if polls:
            arrivals.poll()
        if not (data := os.read(port, 4096)):
            return
        if polls:
            with lock:
                pass
        work(relay, data)


if __name__ == "__main__":
    main()
