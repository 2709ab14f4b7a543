# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Random input from ROS: messages of any content and size, invalid bytes, and service calls."""

import struct
from collections.abc import Callable
from random import Random
from typing import Any, Final

from driver_process import PATIENCE_S
from geometry_msgs.msg import PoseStamped, Twist
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy._rclpy_pybind11 import RCLError
from rclpy.duration import Duration
from rig import Rig
from std_msgs.msg import Bool, Float32MultiArray
from std_srvs.srv import SetBool, Trigger

CALLS_ONE_IN: Final = 20
BURST: Final = 10
"""Number of messages per tick of 10 ms. There are 1000 messages a second."""
HELD: Final = 0.99
"""Least share of the board's IMU frames that the driver must publish.

The share covers the time from the beginning of the random input until 2 s after its end.
"""
CDR_LITTLE_ENDIAN: Final = b"\x00\x01\x00\x00"


def odd_float(random: Random) -> float:
    """Return a random 64-bit float, or one of several usual or special values, such as 0 or NaN."""
    anything = struct.unpack("d", random.randbytes(8))[0]
    usual = (0.0, -0.0, 0.3, -0.3, 1e-300, 1e300, float("nan"), float("inf"), -float("inf"))
    return random.choice((*usual, anything))


def twist(random: Random) -> Twist:
    message = Twist()
    for vector in (message.linear, message.angular):
        vector.x, vector.y, vector.z = (odd_float(random) for _ in range(3))
    return message


def wheels(random: Random) -> Float32MultiArray:
    size = random.choice((0, 1, 2, 3, 3, 3, 4, 100))
    fitting = (random.uniform(-1e3, 1e3), float("nan"), float("inf"))
    return Float32MultiArray(data=[random.choice(fitting) for _ in range(size)])


def pose(random: Random) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = random.choice(("", "odom", "map", "x" * 1000))
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = (odd_float(random) for _ in range(3))
    turn.x, turn.y, turn.z, turn.w = (odd_float(random) for _ in range(4))
    return message


def no_message(random: Random) -> bytes:
    """Return random bytes in place of a serialized message. They may happen to be valid."""
    return CDR_LITTLE_ENDIAN + random.randbytes(random.randrange(64))


def parameters(random: Random) -> SetParameters.Request:
    """Return a random request that sets a parameter to some value.

    The parameter may be read-only or unknown, and the value may be wrong.
    """
    value = random.choice(
        (
            ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=odd_float(random)),
            ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=-1),
            ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="x"),
            ParameterValue(type=ParameterType.PARAMETER_NOT_SET),
        )
    )
    name = random.choice(("port", "odom_frame", "no_such_parameter", "axis_signs", "baudrate"))
    return SetParameters.Request(parameters=[Parameter(name=name, value=value)])


def fuzz(rig: Rig, count: int, random: Random) -> None:
    """Send random messages and calls. Calls must be answered, and the node must still publish."""
    probe = rig.probe
    estop = probe.publisher(Bool, "estop")
    publishers = [
        (probe.publisher(Twist, "cmd_vel"), twist),
        (probe.publisher(Float32MultiArray, "wheel_cmd"), wheels),
        (probe.publisher(PoseStamped, "cmd_pose"), pose),
        (estop, lambda random: Bool(data=random.random() < 0.1)),
    ]
    calls: list[tuple[Any, Callable[[Random], Any]]] = [
        (probe.client(Trigger, "start"), lambda _: Trigger.Request()),
        (probe.client(Trigger, "reset"), lambda _: Trigger.Request()),
        (probe.client(Trigger, "reset_odometry"), lambda _: Trigger.Request()),
        (
            probe.client(SetBool, "pause"),
            lambda random: SetBool.Request(data=random.random() < 0.5),
        ),
        (
            probe.client(SetBool, "estop"),
            lambda random: SetBool.Request(data=random.random() < 0.5),
        ),
        (probe.client(SetParameters, "set_parameters"), parameters),
    ]
    futures = []
    stops = 0
    heard, sent = len(rig.imu), len(rig.line.sent)
    for number in range(count):
        if number % BURST == 0:
            rig.wait_ticks(1)
        if random.randrange(CALLS_ONE_IN) == 0:
            client, request = random.choice(calls)
            futures.append(client.call_async(request(random)))
            continue
        publisher, message = random.choice(publishers)
        stops += publisher is estop
        odd = random.random() < 0.1
        try:
            publisher.publish(no_message(random) if odd else message(random))
        except RCLError:
            assert odd  # our own middleware refuses to send such bytes
    for future in futures:
        probe.wait_for_future(future)
    # The driver's queue may still hold messages of estop. The driver takes one for each call.
    assert estop.wait_for_all_acked(Duration(seconds=PATIENCE_S))
    release = probe.client(SetBool, "estop")
    for future in [release.call_async(SetBool.Request(data=False)) for _ in range(stops)]:
        probe.wait_for_future(future)
    probe.call(SetBool, "estop", data=False)
    probe.call(Trigger, "start")
    for publisher, _ in publishers:
        probe.remove(publisher)
    rig.findings.expect(rig.driver.process.poll() is None, "the node has died")
    rig.wait_ticks(200)
    imus = sum(frame[:2] == b"\xff\xfa" for frame in rig.line.sent[sent:])
    held = probe.comes_about(lambda: len(rig.imu) - heard >= HELD * imus)
    rig.findings.expect(held, f"{len(rig.imu) - heard} of {imus} Imu messages were published")
