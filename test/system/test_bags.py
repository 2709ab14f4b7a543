# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that record a driver's topics to a bag, and replay the recorded bytes in other drivers."""

import signal
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rosbags")

from bag import TYPES, Message, Recorder, as_played, equal, message_class, read
from driver_process import Driver
from geometry_msgs.msg import Twist
from probe import Probe
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import StoragePlugin
from std_srvs.srv import SetBool

MEASURED = {"imu/data_raw": "sensor_msgs/msg/Imu", "odom": "nav_msgs/msg/Odometry"}
RAW = ("omnibot_driver/raw_rx", "omnibot_driver/raw_tx")
ZEROS = bytes(8)
STOP = ZEROS + bytes.fromhex("FF FE 02 00 00 00 00 00 00")


@dataclass
class Drive:
    """A recorded drive on a simulated board, with the namespace of its topics."""

    recorder: Recorder
    namespace: str
    bag: Path

    def heard(self, topic: str) -> list[bytes]:
        return [data for _, data in self.recorder.messages[f"/{self.namespace}/{topic}"]]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    with ExitStack() as stack:
        driver = stack.enter_context(Driver(port="sim://?seed=1", publish_raw="true"))
        probe = stack.enter_context(Probe.of(driver))
        probe.wait_for_state("nominal")
        recorder = Recorder(probe)
        recorder.record(*MEASURED, *RAW)
        imu = recorder.messages[f"/{driver.namespace}/imu/data_raw"]
        cmd_vel = probe.publisher(Twist, "cmd_vel")
        probe.wait_for(lambda: imu)
        twist = Twist()
        twist.linear.x, twist.angular.z = 0.3, 0.4
        for goal in range(len(imu) + 20, len(imu) + 200, 20):
            cmd_vel.publish(twist)
            probe.wait_for(lambda goal=goal: len(imu) >= goal)
        assert probe.call(SetBool, "pause", data=True).success
        assert driver.end(signal.SIGINT) == 0
    bag = tmp_path_factory.mktemp("drive") / "bag"
    recorder.write(bag, StoragePlugin.MCAP)
    return Drive(recorder, driver.namespace, bag)


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_every_topic_comes_out_of_a_bag_as_it_went_in(
    drive: Drive, tmp_path: Path, plugin: StoragePlugin
) -> None:
    """All topics of a drive are written to a bag, in the format SQLite or MCAP.

    The bag then contains the same bytes, times and qualities of service.
    """
    recorder = drive.recorder
    recorder.write(tmp_path / "bag", plugin)
    messages, offered = read(tmp_path / "bag")
    assert messages == {topic: sorted(heard) for topic, heard in recorder.messages.items()}
    assert all(messages[f"/{drive.namespace}/{topic}"] for topic in (*MEASURED, *RAW))
    assert offered == recorder.offered


def test_who_knows_only_the_standard_types_reads_them_all(drive: Drive) -> None:
    """Each recorded message is decoded twice: by rclpy, and with the standard types of Jazzy.

    Both results have equal fields.
    """
    for topic, kind in drive.recorder.types.items():
        for _, data in drive.recorder.messages[topic]:
            ours = deserialize_message(data, message_class(kind))
            assert equal(ours, TYPES.deserialize_cdr(data, kind)), topic


def test_a_bag_played_back_is_heard_as_it_was(drive: Drive) -> None:
    """A bag's messages are published again, with their recorded types and qualities of service.

    A subscriber receives the same bytes as in the bag.
    """
    messages, offered = read(drive.bag)
    topics = [topic for topic in messages if topic.startswith(f"/{drive.namespace}/")]
    with Probe("playback") as probe:
        recorder = Recorder(probe)
        for topic in topics:
            kind, qos = drive.recorder.types[topic], as_played(offered[topic])
            again = f"/playback{topic}"
            heard = recorder.hear(again, kind, qos)
            publisher = probe.publisher(message_class(kind), again, qos)
            played = [data for _, data in messages[topic]]
            for data in played:
                publisher.publish(data)
            probe.wait_for(lambda heard=heard, played=played: len(heard) >= len(played))
            assert [data for _, data in heard] == played


def wire(drive: Drive, topic: str) -> list[bytes]:
    return [
        deserialize_message(data, message_class("std_msgs/msg/UInt8MultiArray")).data.tobytes()
        for data in drive.heard(topic)
    ]


def test_the_wire_is_recorded_in_both_directions(drive: Drive) -> None:
    """Each read of the port is a message on one raw topic, and each write a message on another."""
    received, sent = (wire(drive, topic) for topic in RAW)
    assert b"\xff\xfa" in b"".join(received)
    assert b"Paused: 0 \n" in b"".join(received)
    assert STOP in sent
    assert STOP + ZEROS + b"P" in sent
    assert any(data.startswith(bytes(4) + b"\xff\xfe\x01") and len(data) == 13 for data in sent)


def test_every_replay_of_a_bag_is_the_same(drive: Drive) -> None:
    """Two drivers replay one bag. They publish identical messages, and run on after the replay."""
    with ExitStack() as stack:
        replays = [replay(stack, drive) for _ in range(2)]
        for driver, probe, _ in replays:
            driver.wait_for_line("the recording has ended; press ctrl-C to end the driver")
            probe.wait_for_state("disconnected")
        for topic, kind in MEASURED.items():
            first, second = (by_stamp(heard[topic], kind) for _, _, heard in replays)
            both = first.keys() & second.keys()
            live = drive.heard(topic)
            enough = len(live) // 2
            assert len(both) > enough
            assert all(first[stamp] == second[stamp] for stamp in both)
            # Once both replays run, their messages have the order and the values of the live drive.
            told = iter([measured(data, kind) for data in live])
            again = [measured(data, kind) for data in first.values()]
            assert all(item in told for item in again[-enough:])


def replay(stack: ExitStack, drive: Drive) -> tuple[Driver, Probe, dict[str, list[Message]]]:
    """Start a driver that replays the recorded bytes.

    Return the driver, its probe, and the messages by topic.
    """
    driver = stack.enter_context(Driver(port=f"replay://{drive.bag}?speed=4&delay=7"))
    probe = stack.enter_context(Probe.of(driver))
    heard = {}
    for topic, kind in MEASURED.items():
        qos = as_played(drive.recorder.offered[f"/{drive.namespace}/{topic}"])
        heard[topic] = Recorder(probe).hear(f"/{driver.namespace}/{topic}", kind, qos)
    return driver, probe, heard


def by_stamp(messages: list[Message], kind: str) -> dict[tuple[int, int], bytes]:
    found = {}
    for _, data in messages:
        stamp = deserialize_message(data, message_class(kind)).header.stamp
        found[stamp.sec, stamp.nanosec] = data
    return found


def measured(data: bytes, kind: str) -> Any:
    """Return the fields of a message that do not depend on the time or on the initial pose."""
    message = deserialize_message(data, message_class(kind))
    if kind == MEASURED["odom"]:
        return message.twist
    return message.angular_velocity, message.linear_acceleration
