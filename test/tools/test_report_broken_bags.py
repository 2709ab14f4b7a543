# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of unfinished or damaged bags: the report uses the intact part, and names the damage."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from drives import START_NS, TYPES, Drive, message, write
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer

from omnibot_driver.tools.needs import ToolError
from omnibot_driver.tools.report import page
from omnibot_driver.tools.report.__main__ import main
from omnibot_driver.tools.report.bag import read
from omnibot_driver.tools.report.log import Log

SECONDS = 4.0
CHUNK = 0x06
STATUS = "diagnostic_msgs/msg/DiagnosticStatus"


@pytest.fixture
def drive() -> Drive:
    return Drive(SECONDS)


@pytest.fixture(scope="module")
def long_drive() -> Drive:
    """A drive whose MCAP file has several chunks."""
    return Drive(40.0)


@pytest.fixture(scope="module")
def long_bag(long_drive: Drive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of the long drive, without compression. Tests change only copies of it."""
    return write(tmp_path_factory.mktemp("long") / "bag", [long_drive])


def log_of(path: Path) -> Log:
    return read(path, None, lambda _done, _total: None)


def cut(bag: Path, end: int) -> Path:
    """Return the bag's only file, cut to ``end`` bytes as if the recorder had been killed."""
    (bag / "metadata.yaml").unlink()
    (file,) = bag.iterdir()
    file.write_bytes(file.read_bytes()[:end])
    return file


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_an_unfinished_bag_is_read_and_called_so(
    drive: Drive,
    tmp_path: Path,
    plugin: StoragePlugin,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A bag is unfinished. The report reads it, and names the command that repairs it.

    The exit code is 3.
    """
    monkeypatch.setattr(page, "PICTURES", ())
    bag = write(tmp_path / "bag", [drive], plugin)
    (bag / "metadata.yaml").unlink()
    assert main([str(bag), "--output", str(tmp_path / "out")]) == 3
    assert "never finished" in (text := capsys.readouterr().out)
    assert f"ros2 bag reindex {bag}" in text
    assert len(log_of(bag).imu) == len(drive.imu.stamp_s)


def test_files_of_an_unfinished_bag_are_put_in_order_by_their_times(tmp_path: Path) -> None:
    """An unfinished bag has several files. They are sorted by time, not by name.

    By name, bag_10 would be before bag_2.
    """
    bag = tmp_path / "bag"
    bag.mkdir()
    for name, first in (("bag_2", 0), ("bag_10", 10)):
        kind = "diagnostic_msgs/msg/DiagnosticArray"
        with Writer(tmp_path / name, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = (("/odom", "nav_msgs/msg/Odometry"), ("/diagnostics", kind))
            _, told = (writer.add_connection(*topic, typestore=TYPES) for topic in topics)
            for at_s in range(first, first + 10):
                status = (0, "name", "", "", [])
                text = message(kind, ((0, 0), ""), [message(STATUS, *status)])
                writer.write(told, START_NS + at_s * 10**9, TYPES.serialize_cdr(text, kind))
        shutil.copy(tmp_path / name / f"{name}.mcap", bag)
    log = log_of(bag)
    assert [status.at_s for status in log.diagnostics] == list(range(20))
    assert log.duration_s == 19.0


@pytest.mark.parametrize("text", ["", "a: [", "rosbag2_bagfile_information: 7", "\x00"])
def test_metadata_that_make_no_sense_are_not_needed(
    drive: Drive, tmp_path: Path, text: str
) -> None:
    """The metadata of a bag are invalid. The report reads the other files, and names the damage."""
    bag = write(tmp_path / "bag", [drive])
    (bag / "metadata.yaml").write_text(text)
    log = log_of(bag)
    assert len(log.imu) == len(drive.imu.stamp_s)
    (trouble,) = log.troubles
    assert trouble.startswith("the bag is damaged (")
    assert f"ros2 bag reindex {bag}" in trouble


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.STORAGE])
def test_an_mcap_that_breaks_off_is_read_as_far_as_it_is_whole(
    tmp_path: Path, mode: CompressionMode, long_drive: Drive, long_bag: Path
) -> None:
    """An MCAP file is cut off within a chunk. The report reads all chunks before this one."""
    drive, bag = long_drive, tmp_path / "bag"
    if mode is CompressionMode.NONE:
        shutil.copytree(long_bag, bag)
    else:
        write(bag, [drive], compression=mode)
    size = (bag / "bag.mcap").stat().st_size
    file = cut(bag, size * 9 // 10)
    log = log_of(bag)
    assert f"the file {file.name} is incomplete" in log.troubles[1]
    assert 0.3 * len(drive.imu.stamp_s) < len(log.imu) < len(drive.imu.stamp_s)
    np.testing.assert_array_equal(log.imu.values, drive.imu.series().values[: len(log.imu)])
    assert len(log_of(file).imu) == len(log.imu)
    assert file.stat().st_size == size * 9 // 10  # the file is not changed


def test_an_mcap_with_its_end_overwritten_by_zeros_is_read(tmp_path: Path, long_bag: Path) -> None:
    """An MCAP file ends in zeros, as after a power failure. The report reads it up to the zeros."""
    bag = Path(shutil.copytree(long_bag, tmp_path / "bag"))
    size = (bag / "bag.mcap").stat().st_size
    file = cut(bag, size * 9 // 10)
    whole = len(log_of(file).imu)
    with file.open("ab") as target:
        target.write(bytes(5000))
    assert len(log_of(file).imu) == whole


def test_an_mcap_without_chunks_and_order_is_read(tmp_path: Path) -> None:
    """An MCAP file has no chunks. The report reads it up to its first incomplete record.

    The messages are sorted by arrival.
    """
    kind = "std_msgs/msg/Bool"
    bag = tmp_path / "bag"
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = (
            ("/omnibot_driver/state", "std_msgs/msg/String"),
            ("/omnibot_driver/estop_active", kind),
        )
        _, estop = (writer.add_connection(*topic, typestore=TYPES) for topic in topics)
        for at_s, on in ((0, False), (9, False), (4, True)):
            data = TYPES.serialize_cdr(message(kind, on), kind)
            writer.write(estop, START_NS + at_s * 10**9, data)
    file = bag / "bag.mcap"
    chunked = file.read_bytes()
    begin = 8 + 9 + int.from_bytes(chunked[9:17], "little")
    assert chunked[begin] == CHUNK
    size = int.from_bytes(chunked[begin + 17 + 8 : begin + 17 + 16], "little")
    first = begin + 9 + 8 + 8 + 8 + 4 + 4 + 8
    file.write_bytes(chunked[:begin] + chunked[first : first + size] + b"\x05\x40")
    log = log_of(file)
    assert [(span.begin_s, span.what) for span in log.estops] == [
        (0.0, "free"),
        (4.0, "latched"),
        (9.0, "free"),
    ]


@pytest.mark.parametrize("size", [0, 8, 20])
def test_an_mcap_in_which_nothing_is_whole_is_told(drive: Drive, tmp_path: Path, size: int) -> None:
    """An MCAP file has no complete part. The error names ``ros2 bag reindex``."""
    bag = write(tmp_path / "bag", [drive])
    file = cut(bag, size)
    with pytest.raises(ToolError, match=f"{file.name} cannot be read: .*ros2 bag reindex {bag}"):
        log_of(bag)


def test_an_mcap_that_breaks_off_in_its_first_chunk_is_not_called_empty(
    drive: Drive, tmp_path: Path
) -> None:
    """The only chunk of an MCAP file is cut off. The error does not say that the bag is empty.

    It says that the file is incomplete.
    """
    bag = write(tmp_path / "bag", [drive])
    file = cut(bag, 5000)
    with pytest.raises(ToolError, match=f"no message that can be .* {file.name} is incomplete"):
        log_of(bag)


def test_what_sqlite_has_not_moved_into_the_database_is_read(drive: Drive, tmp_path: Path) -> None:
    """A killed recorder leaves a write-ahead log beside the database. The report reads it, too."""
    bag = write(tmp_path / "bag", [drive], StoragePlugin.SQLITE3)
    killed = tmp_path / "killed"
    killed.mkdir()
    with closing(sqlite3.connect(bag / "bag.db3")) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("DELETE FROM messages WHERE id > 100")
        database.commit()
        for file in bag.glob("bag.db3*"):
            shutil.copy(file, killed)
    assert (killed / "bag.db3-wal").stat().st_size
    log = log_of(killed)
    assert len(log.imu) < 100
    assert sorted(file.name for file in killed.glob("*.db3-wal")) == ["bag.db3-wal"]


def test_damaged_messages_are_counted_and_passed_over(drive: Drive, tmp_path: Path) -> None:
    """One message is damaged. The report counts and skips it, and reads all others."""
    with Writer(tmp_path / "bag", version=9) as writer:
        connections = {}
        for number, (topic, kind, at_ns, told) in enumerate(drive.messages()):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            data = bytes(TYPES.serialize_cdr(told, kind))
            writer.write(connections[topic], at_ns, data[:20] if number == 500 else data)
    assert log_of(tmp_path / "bag").troubles == ("1 message damaged and skipped",)
