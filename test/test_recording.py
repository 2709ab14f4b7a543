# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``replay://``, which reads the recorded bytes of a line from a bag.

Unsuitable bags and options are refused with a message.
"""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

pytest.importorskip("rosbags")

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from omnibot_driver.core.errors import LinkError, ParameterError
from omnibot_driver.recording import is_recording, open_recording
from omnibot_driver.salvage import DATA_END, MAGIC

TYPES = get_typestore(Stores.ROS2_JAZZY)
RAW = "std_msgs/msg/UInt8MultiArray"
RX = "/omnibot_driver/raw_rx"
CHUNKS = [
    (1_790_000_000_000_000_000, b"Paused: 0 \n"),
    (1_790_000_000_000_000_001, b"\xff\xfa\x00"),
    (1_790_000_002_000_000_000, b"\n"),
]
MESSAGE = 0x05
"""Kind of an mcap record that contains a message."""
PACKETS = [(at_ns, (0, data)) for at_ns, data in CHUNKS]


def cdr(data: bytes) -> bytes:
    # CDR by hand: the header for little endian, no dimensions, offset 0, the number of bytes,
    # and the bytes.
    header = bytes.fromhex("00 01 00 00")
    return header + bytes(8) + len(data).to_bytes(4, "little") + data


def bag(
    path: Path, *topics: str, plugin: StoragePlugin = StoragePlugin.MCAP, kind: str = RAW
) -> Path:
    """Write a bag in which each topic contains the packets of ``CHUNKS``, and return its path."""
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for topic in topics:
            connection = writer.add_connection(topic, kind, typestore=TYPES)
            for at_ns, data in CHUNKS:
                writer.write(connection, at_ns, cdr(data))
    return path


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_every_byte_comes_back_with_its_time(tmp_path: Path, plugin: StoragePlugin) -> None:
    """The replay reads the same bytes from a bag's folder and its file, in SQLite and MCAP."""
    path = bag(tmp_path / "bag", "/omnibot_driver/raw_tx", RX, plugin=plugin)
    (file,) = (found for found in path.iterdir() if found.suffix != ".yaml")
    for place in (path, file):
        assert list(open_recording(f"replay://{place}").chunks()) == PACKETS


def test_options_say_how_fast_when_and_what(tmp_path: Path) -> None:
    """Options of the URL set the speed, the delay and the topic.

    The bag has two robots, and the topic selects one of them.
    """
    path = bag(tmp_path / "bag", "/robot1/omnibot_driver/raw_rx", "/robot2/omnibot_driver/raw_rx")
    recording = open_recording(
        f"replay://{path}?speed=2.5&delay=0&topic=/robot2/omnibot_driver/raw_rx"
    )
    assert (recording.speed, recording.delay_s) == (2.5, 0.0)
    assert recording.topics == ("/robot2/omnibot_driver/raw_rx",)
    assert list(recording.chunks()) == PACKETS


def test_each_line_of_a_board_with_several_comes_back_as_its_channel(tmp_path: Path) -> None:
    """A user chooses the topic of one line in a bag. All lines of the same robot are replayed.

    The bytes of each line reach the channel of this line.
    """
    path = bag(tmp_path / "bag", *(f"/{who}{RX}/{name}" for who in "ab" for name in ("one", "two")))
    recording = open_recording(f"replay://{path}?topic=/b{RX}/one", ("two", "one"))
    assert recording.topics == (f"/b{RX}/two", f"/b{RX}/one")
    expected = {(at_ns, (channel, data)) for at_ns, data in CHUNKS for channel in (0, 1)}
    assert set(recording.chunks()) == expected
    with pytest.raises(ParameterError, match="choose one of the bag's topics"):
        open_recording(f"replay://{path}", ("two", "one"))


def test_without_options_it_is_played_at_its_own_speed_after_five_seconds(tmp_path: Path) -> None:
    """Without options, the bag's only topic is played at speed 1, after 5 s.

    During the 5 s, other nodes find the driver.
    """
    recording = open_recording(f"replay://{bag(tmp_path / 'bag', RX)}")
    assert (recording.speed, recording.delay_s, recording.topics) == (1.0, 5.0, (RX,))


@pytest.mark.parametrize(
    ("query", "why"),
    [
        ("?speed=0", "speed must be 0.01 to inf, not '0'"),
        ("?speed=fast", "speed must be 0.01 to inf, not 'fast'"),
        ("?speed=nan", "speed must be 0.01 to inf, not 'nan'"),
        ("?delay=-1", "delay must be 0 to 3600, not '-1'"),
        ("?rate=2", "there is no option 'rate', only speed, delay and topic"),
        ("?topic=/odom", f"choose one of the bag's topics with topic={RX}"),
    ],
)
def test_options_that_make_no_sense_are_refused(tmp_path: Path, query: str, why: str) -> None:
    """The message for an invalid option says what is allowed."""
    path = bag(tmp_path / "bag", RX)
    with pytest.raises(ParameterError) as refusal:
        open_recording(f"replay://{path}{query}")
    assert str(refusal.value) == f"port 'replay://{path}{query}' is not valid: {why}"


def test_a_bag_without_the_wire_says_how_to_record_it(tmp_path: Path) -> None:
    """A bag without raw bytes is refused. The message says how to record them.

    The driver publishes raw bytes only with ``publish_raw``, so without it no bag can have them.
    """
    path = bag(tmp_path / "bag", "/odom", kind="std_msgs/msg/String")
    with pytest.raises(ParameterError, match="record with `publish_raw: true`"):
        open_recording(f"replay://{path}")


def test_a_bag_of_two_robots_is_not_guessed_at(tmp_path: Path) -> None:
    """A bag has two robots, and no topic is chosen. The message names the topics of both."""
    path = bag(tmp_path / "bag", "/b/raw_rx", "/a/raw_rx")
    with pytest.raises(ParameterError, match="topic=/a/raw_rx or topic=/b/raw_rx"):
        open_recording(f"replay://{path}")


@pytest.mark.parametrize(
    ("recorded", "channels", "query", "needed"),
    [
        (("/drive", "/front"), ("",), "", "raw_rx"),
        (("",), ("drive", "front"), "", "raw_rx/drive or raw_rx/front"),
        (("",), ("drive", "front"), f"?topic={RX}", "raw_rx/drive or raw_rx/front"),
    ],
)
def test_the_bag_of_another_board_names_the_missing_lines_and_the_board(
    tmp_path: Path, recorded: Sequence[str], channels: Sequence[str], query: str, needed: str
) -> None:
    """If a bag is of another board, the message names the needed lines and those in the bag.

    The message also names the parameter ``board``.
    """
    present = [RX + name for name in recorded]
    sent = "/omnibot_driver/raw_tx"
    path = bag(tmp_path / "bag", *present, *(sent + name for name in recorded))
    with pytest.raises(ParameterError) as refusal:
        open_recording(f"replay://{path}{query}", channels)
    text = str(refusal.value)
    assert f"this board needs a topic {needed}, but the bag has {', '.join(present)};" in text
    assert "check the parameter `board`" in text


def test_what_is_not_a_bag_is_refused(tmp_path: Path) -> None:
    """A path is refused if it does not exist, or if it is not a readable bag."""
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "torn.mcap").write_bytes(b"\x89MCAP0\r\n")
    for name, why in (
        ("nothing", "there is no"),
        (".", "is not a readable bag"),
        ("notes.txt", "is not a readable bag"),
        ("torn.mcap", "is not a readable bag"),
    ):
        with pytest.raises(ParameterError, match=why):
            open_recording(f"replay://{tmp_path / name}")


def test_without_the_library_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library rosbags is missing. The message says how to install it.

    Only a replay needs this library.
    """
    path = bag(tmp_path / "bag", RX)
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(ParameterError) as refusal:
        open_recording(f"replay://{path}")
    assert str(refusal.value) == (
        f"port 'replay://{path}' needs the Python library rosbags: `pip install --user"
        " --break-system-packages rosbags` (in a virtual environment `pip install rosbags`)"
    )


def test_a_bag_that_is_damaged_later_ends_with_a_sentence(tmp_path: Path) -> None:
    """A bag is removed after the replay has opened it. The next read raises an error.

    The error says that the bag cannot be read any further.
    """
    recording = open_recording(f"replay://{bag(tmp_path / 'bag', RX)}")
    shutil.rmtree(tmp_path / "bag")
    with pytest.raises(LinkError, match="cannot be read any further"):
        list(recording.chunks())


@pytest.mark.parametrize("given", ["file", "folder", "reindexed folder"])
def test_the_bag_of_a_killed_recorder_is_read_as_far_as_it_is_whole(
    tmp_path: Path, given: str
) -> None:
    """From the bag of a killed recorder, the replay has every complete packet, and no more.

    The replay says what is incomplete, and does not change the bag.
    """
    path = bag(tmp_path / "bag", RX)
    file = path / "bag.mcap"
    content = file.read_bytes()
    end = len(MAGIC)
    while content[end] != DATA_END:
        end += 9 + int.from_bytes(content[end + 1 : end + 9], "little")
    file.write_bytes(content[:end] + b"\x05\x40")
    if given != "reindexed folder":
        (path / "metadata.yaml").unlink()
    recording = open_recording(f"replay://{file if given == 'file' else path}")
    chunks = recording.chunks()
    assert [next(chunks) for _ in PACKETS] == PACKETS
    with pytest.raises(LinkError, match=r"any further: .*the file bag\.mcap is incomplete"):
        next(chunks)
    assert file.read_bytes() == content[:end] + b"\x05\x40"


def test_a_bag_that_breaks_off_before_its_first_message_says_so(tmp_path: Path) -> None:
    """The bag of a killed recorder has no complete message.

    The error says that the topic raw_rx is missing, and that the bag is incomplete, which is the
    cause.
    """
    file = bag(tmp_path / "bag", RX) / "bag.mcap"
    file.write_bytes(file.read_bytes()[:60])
    (tmp_path / "bag/metadata.yaml").unlink()
    with pytest.raises(ParameterError, match=r"no topic raw_rx.*bag\.mcap is incomplete"):
        open_recording(f"replay://{tmp_path / 'bag'}")


@pytest.mark.parametrize("given", ["file", "folder"])
def test_a_damaged_part_within_a_bag_is_reported(tmp_path: Path, given: str) -> None:
    """A part of a finished mcap file is damaged, and the library skips what follows in its chunk.

    The replay has the packets before the damage. Then it reports how many messages can be read.
    """
    path = bag(tmp_path / "bag", RX)
    file = path / "bag.mcap"
    content = file.read_bytes()
    record = content.index(CHUNKS[1][0].to_bytes(8, "little")) - 15
    assert content[record] == MESSAGE
    file.write_bytes(content[:record] + b"\x55" * 9 + content[record + 9 :])
    chunks = open_recording(f"replay://{file if given == 'file' else path}").chunks()
    assert next(chunks) == PACKETS[0]
    with pytest.raises(LinkError, match=r"is damaged: only 1 of 3 messages can be read"):
        next(chunks)


def test_only_its_own_urls_are_taken() -> None:
    """A URL that begins with ``replay:`` is a recording. A device name or another URL is not."""
    assert is_recording("replay://x")
    assert not is_recording("/dev/replay")
    assert not is_recording("sim://")
