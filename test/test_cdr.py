# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver's own serializer. It makes the same bytes as rclpy."""

import struct
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import Quaternion, Twist, Vector3
from hypothesis import given
from hypothesis import settings as limits
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState

from omnibot_driver import boards, cdr
from omnibot_driver.boards import omnibot
from omnibot_driver.cdr import Messages, Serializer, difference
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.messages import MessageSettings, Wheels, turned, unturned

DEFAULTS = boards.check_all({})

numbers = st.floats(allow_nan=False, allow_infinity=False, width=32)
vectors = st.tuples(numbers, numbers, numbers)
poses = st.builds(Pose, *[numbers] * 3)
twists = st.none() | st.builds(BodyTwist, *[numbers] * 3)
stamps_ns = st.integers(0, 2**31 * 10**9 - 1)
frames = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
imus = st.builds(ImuEstimate, numbers, vectors, vectors)
odometries = st.builds(
    OdometryEstimate, numbers, poses, twists, st.builds(Covariance, *[numbers] * 6)
)
joints = st.tuples(poses, vectors, vectors | st.just(()))


STORE = get_typestore(Stores.ROS2_JAZZY)


def message_name(message: object) -> str:
    """Return the name of a message's type, in the form "sensor_msgs/msg/Imu" that rosbags needs."""
    return f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"


@st.composite
def settings(draw: st.DrawFn) -> MessageSettings:
    """Return random message settings, with any noise and with frame names of any length."""
    values: dict[str, Any] = boards.check_all({})
    values |= {name: draw(frames) for name in ("odom_frame", "base_frame", "imu_frame")}
    values |= {name: draw(st.floats(1e-6, 10.0)) for name in values if name.endswith("stddev")}
    return MessageSettings.from_parameters(values, omnibot.kinematics(values))


def padded(data: bytes, like: bytes) -> bytes:
    """Return ``data`` with its padding bytes replaced by those of ``like``.

    rclpy leaves arbitrary values in the bytes between the NUL of a string and the next multiple of
    eight.
    """
    same = bytearray(data)
    for at, (ours, theirs) in enumerate(zip(data, like, strict=False)):
        if ours == 0 and theirs != 0 and 0 in data[max(0, at - 7) : at]:
            same[at] = theirs
    return bytes(same)


@limits(max_examples=40)
@given(settings(), imus, odometries, joints, stamps_ns)
def test_the_bytes_are_rclpys_for_any_values_and_frames(
    chosen: MessageSettings,
    imu: ImuEstimate,
    odometry: OdometryEstimate,
    wheels: Wheels,
    stamp_ns: int,
) -> None:
    """The driver's bytes equal those of rclpy, except for padding.

    Deserializing both gives the same message.
    """
    serializer, messages = Serializer(chosen), Messages(chosen)
    for ours, message in (
        (serializer.imu(imu, stamp_ns), messages.imu(imu, stamp_ns)),
        (serializer.odometry(odometry, stamp_ns), messages.odometry(odometry, stamp_ns)),
        (serializer.joint_state(wheels, stamp_ns), messages.joint_state(wheels, stamp_ns)),
    ):
        theirs = serialize_message(message)
        assert padded(ours, theirs) == theirs[: len(ours)]
        STORE.deserialize_cdr(ours, message_name(message))  # raises at any surplus byte
        kind = type(message)
        assert deserialize_message(ours, kind) == deserialize_message(theirs, kind)


def test_two_wheels_are_two_joints_with_names_of_their_own() -> None:
    """A robot with two wheels of radius 0.1 m drives 1 m forward.

    Both its joints turn by 10 rad.
    """
    two = replace(
        MessageSettings.from_parameters(DEFAULTS, omnibot.kinematics(DEFAULTS)),
        wheels=DifferentialKinematics(wheel_radius_m=0.1, track_m=0.4),
    )
    ahead = OdometryEstimate(
        0.0, Pose(), None, Covariance(), Pose(1.0, 0.0, 0.0), BodyTwist(0.5, 0.0, 0.0)
    )
    wheels = turned(unturned(two.wheels), ahead, two.wheels)
    message = deserialize_message(Serializer(two).joint_state(wheels, 7), JointState)
    assert message.position == Messages(two).joint_state(wheels, 7).position
    assert list(message.name) == ["left_wheel_joint", "right_wheel_joint"]
    assert list(message.position) == pytest.approx([10.0, 10.0])
    assert list(message.velocity) == pytest.approx([5.0, 5.0])


@pytest.mark.parametrize("length", range(21))
def test_no_frame_length_is_refused_at_start(length: int) -> None:
    """At start, the driver's serializer passes its check with frame names of any length.

    The length of a name decides how the numbers after the name are aligned.
    """
    values = boards.check_all({"imu_frame": "i" * length or "x", "odom_frame": "o" * 7})
    assert difference(MessageSettings.from_parameters(values, omnibot.kinematics(values))) == ""


@pytest.mark.parametrize(
    ("name", "wrong", "strange"),
    [
        ("NO_TURN", (0.0, 0.0, 1.0, 0.0), "Imu"),
        ("AT_REST", (0.0,) * 5 + (1e-9,), "Odometry"),
        ("LITTLE_ENDIAN", struct.pack(">I", 0), "Imu"),
    ],
)
def test_a_difference_is_found_at_start(
    monkeypatch: pytest.MonkeyPatch, name: str, wrong: object, strange: str
) -> None:
    """The driver's serializer writes a wrong value in a constant part of a message.

    At start, the comparison with rclpy's bytes finds this.
    """
    monkeypatch.setattr(cdr, name, wrong)
    chosen = MessageSettings.from_parameters(DEFAULTS, omnibot.kinematics(DEFAULTS))
    assert difference(chosen) == strange


def test_the_orientation_that_is_none_is_the_messages_default() -> None:
    """The default quaternion of rclpy is the identity, as in the driver's serializer."""
    nothing = Quaternion()
    assert (nothing.x, nothing.y, nothing.z, nothing.w) == cdr.NO_TURN


@given(vectors, vectors)
def test_a_velocity_is_read_from_its_bytes_in_either_byte_order(
    linear: tuple[float, float, float], angular: tuple[float, float, float]
) -> None:
    """A velocity read from serialized bytes equals the message's fields, in both byte orders."""
    (x, y, z), (u, v, w) = linear, angular
    data = serialize_message(Twist(linear=Vector3(x=x, y=y, z=z), angular=Vector3(x=u, y=v, z=w)))
    expected = BodyTwist(x, y, w), z == u == v == 0.0
    assert cdr.twist(data) == expected
    assert cdr.twist(bytes(4) + struct.pack(">6d", *linear, *angular)) == expected


@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("nonsense", [float("nan"), float("inf"), float("-inf")])
def test_bytes_that_say_nonsense_of_one_axis_are_no_command(place: int, nonsense: float) -> None:
    """The driver rejects a Twist with NaN or infinity in any of its six values.

    This also applies to the axes along which the robot cannot move.
    """
    values = [0.1] * 6
    values[place] = nonsense
    with pytest.raises(CommandRefused, match="NaN or infinity"):
        cdr.twist(cdr.LITTLE_ENDIAN + struct.pack("<6d", *values))


@pytest.mark.parametrize("length", range(52))
def test_bytes_that_are_too_few_for_a_velocity_are_no_command(length: int) -> None:
    """The driver rejects a Twist message that has too few bytes."""
    data = cdr.LITTLE_ENDIAN + struct.pack("<6d", *[0.1] * 6)
    with pytest.raises(CommandRefused, match="not a valid Twist"):
        cdr.twist(data[:length])


@pytest.mark.parametrize(
    "wheels",
    [
        DifferentialKinematics(0.05, 0.3),
        OmniKinematics(0.029, 0.143),
        SimpleNamespace(joints=()),
        SimpleNamespace(joints=("a", "bc", "def", "ghij", "k" * 31)),
    ],
    ids=lambda wheels: f"{len(wheels.joints)} joints",
)
def test_any_number_of_wheels_is_serialised_as_rclpy_does(wheels: Any) -> None:
    """The driver serializes a JointState with any number of wheels as rclpy does.

    A robot without wheels is also tested, although the driver does not publish joint_states for it.
    """
    assert difference(MessageSettings.from_parameters(boards.check_all({}), wheels)) == ""
