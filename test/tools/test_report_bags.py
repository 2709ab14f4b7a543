# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the report reads bags of every storage format without ROS.

The report rejects a file that it cannot read.
"""

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drives import TYPES, Drive, write
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer

from omnibot_driver.tools.needs import ToolError
from omnibot_driver.tools.report import page
from omnibot_driver.tools.report.__main__ import main
from omnibot_driver.tools.report.bag import read
from omnibot_driver.tools.report.log import Log

SECONDS = 4.0


@pytest.fixture
def drive() -> Drive:
    return Drive(SECONDS)


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Switch off the pictures of the report, which are slow and have tests of their own."""
    monkeypatch.setattr(page, "PICTURES", ())


def log_of(path: Path, namespace: str | None = None) -> Log:
    return read(path, namespace, lambda _done, _total: None)


def same(ours: Log, theirs: Log) -> None:
    for name in ("imu", "odom", "joint_states", "cmd_vel"):
        mine, his = getattr(ours, name), getattr(theirs, name)
        assert len(mine)
        np.testing.assert_allclose(mine.values, his.values, atol=1e-12)
        np.testing.assert_allclose(mine.arrived_s, his.arrived_s, atol=1e-8)
        if name != "cmd_vel":  # a Twist has no stamp
            np.testing.assert_allclose(mine.stamp_s, his.stamp_s, atol=1e-8)
    assert ours.states[0].what == theirs.states[0].what
    assert len(ours.diagnostics) == len(theirs.diagnostics)
    assert ours.diagnostics[3].values == theirs.diagnostics[3].values


KINDS = [
    (plugin, mode)
    for plugin in StoragePlugin
    for mode in (CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE)
] + [(StoragePlugin.MCAP, CompressionMode.STORAGE)]


@pytest.mark.parametrize(("plugin", "mode"), KINDS, ids=lambda item: item.name)
def test_a_bag_of_any_kind_tells_the_same(
    drive: Drive, tmp_path: Path, plugin: StoragePlugin, mode: CompressionMode
) -> None:
    """Every storage plugin and compression mode gives the same log."""
    bag = write(tmp_path / "bag", [drive], plugin, mode)
    same(log_of(bag), drive.log())


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_a_single_file_of_a_bag_is_enough(
    drive: Drive, tmp_path: Path, plugin: StoragePlugin
) -> None:
    """A killed recorder has not written metadata.yaml.

    The report reads the bag's file without it.
    """
    (file,) = (
        file
        for file in write(tmp_path / "bag", [drive], plugin).iterdir()
        if file.suffix != ".yaml"
    )
    same(log_of(file), drive.log())


def test_stamped_commands_are_commands(drive: Drive, tmp_path: Path) -> None:
    """TwistStamped is read like Twist, and its timestamps are kept."""
    drive.stamped_commands = True
    log = log_of(write(tmp_path / "bag", [drive]))
    np.testing.assert_array_equal(log.cmd_vel.values, drive.cmd_vel.values)
    assert np.isfinite(log.cmd_vel.stamp_s).all()


def test_several_robots_in_a_bag_are_named_and_one_is_asked_for(tmp_path: Path) -> None:
    """A bag has several robots. ``--namespace`` selects the robot whose topics are read."""
    one, other = Drive(SECONDS, "/robot1"), Drive(SECONDS, "/fleet/robot2", seed=2)
    bag = write(tmp_path / "bag", [one, other])
    with pytest.raises(ToolError, match=r"--namespace: /fleet/robot2, /robot1"):
        log_of(bag)
    with pytest.raises(ToolError, match=r"no robot in the namespace /robot3; choose .* /fleet"):
        log_of(bag, "robot3")
    for drive in (one, other):
        log = log_of(bag, drive.namespace[1:])
        np.testing.assert_array_equal(log.imu.values, drive.imu.values)
        assert not log.alone
        assert {"imu/data_raw", "odom", "state", "/diagnostics"} <= {*log.topics}


def test_the_only_robot_needs_no_name(tmp_path: Path) -> None:
    """A bag has one robot, in any namespace. The report finds it."""
    log = log_of(write(tmp_path / "bag", [Drive(SECONDS, "/robot1")]))
    assert log.robot == "/robot1"


def refused(path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Run a report that must end with exit code 1, and return its only line on stderr."""
    assert main([str(path), "--output", str(path.parent / "out")]) == 1
    printed = capsys.readouterr()
    assert not printed.out
    assert printed.err.startswith("report: ")
    assert printed.err.count("\n") == 1
    return printed.err


def test_no_bag_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The path of the bag does not exist. The message asks for the folder of a bag."""
    assert "give the folder of a bag" in refused(tmp_path / "nothing", capsys)


def test_what_is_not_a_bag_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder without a bag, a text file, and broken MCAP and SQLite files are each rejected."""
    (tmp_path / "folder").mkdir()
    assert "neither metadata.yaml nor" in refused(tmp_path / "folder", capsys)
    for name, says in (("a.txt", "is not a bag"), ("a.mcap", "reindex"), ("a.db3", "reindex")):
        (tmp_path / name).write_text("nothing of the kind")
        assert says in refused(tmp_path / name, capsys)


def test_an_empty_bag_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A bag has a topic, but no messages. The error message states that the bag is empty."""
    with Writer(tmp_path / "bag", version=9) as writer:
        writer.add_connection("/imu/data_raw", "sensor_msgs/msg/Imu", typestore=TYPES)
    assert "is empty" in refused(tmp_path / "bag", capsys)


def test_a_bag_of_something_else_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A bag has no topic of a driver. Its topic /odom has another type than a driver's /odom.

    The report rejects the bag.
    """
    with Writer(tmp_path / "bag", version=9) as writer:
        kind = "std_msgs/msg/String"
        data = TYPES.serialize_cdr(TYPES.types[kind]("hello"), kind)
        for topic in ("/chatter", "/odom"):
            writer.write(writer.add_connection(topic, kind, typestore=TYPES), 10**18, data)
    assert "no topic of a driver" in refused(tmp_path / "bag", capsys)


def test_a_robot_without_odometry_is_reported_on_and_is_not_healthy(
    drive: Drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot has no odometry. The report names the missing topic, and the exit code is 3."""
    drive.odom.drop(0.0, SECONDS)
    assert main([str(write(tmp_path / "bag", [drive])), "--output", str(tmp_path / "out")]) == 3
    assert "No message of odom" in capsys.readouterr().out


def test_nothing_but_nan_is_reported_on(
    drive: Drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All values are NaN. The report counts the messages with NaN, and the exit code is 3."""
    for topic in (drive.imu, drive.odom, drive.cmd_vel, drive.joints):
        topic.values[:] = np.nan
    assert main([str(write(tmp_path / "bag", [drive])), "--output", str(tmp_path / "out")]) == 3
    assert f"{len(drive.imu.stamp_s)} messages of imu/data_raw with NaN" in capsys.readouterr().out


def test_a_place_that_cannot_be_written_is_told(
    drive: Drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file has the name of the output folder, so the folder cannot be made.

    The report ends with an error message.
    """
    (tmp_path / "out").write_text("taken")
    assert "cannot be written" in refused(write(tmp_path / "bag", [drive]), capsys)


@pytest.mark.parametrize("wrong", [[], ["bag", "--live", "5"], ["--live", "0"], ["--live", "nan"]])
def test_wrong_usage_is_told(wrong: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """The user gives both a bag and ``--live``, or neither, or a wrong time. The exit code is 2."""
    with pytest.raises(SystemExit) as ended:
        main(wrong)
    assert ended.value.code == 2
    assert "--live" in capsys.readouterr().err


def test_a_bag_is_reported_on_where_there_is_no_ros(drive: Drive, tmp_path: Path) -> None:
    """ROS is not installed, and stdout is closed. The report on a bag is still made."""
    bag = write(tmp_path / "bag", [drive])
    program = (
        "import sys\n"
        "for name in ('rclpy', 'std_msgs', 'sensor_msgs', 'nav_msgs', 'builtin_interfaces'):\n"
        "    sys.modules[name] = None\n"
        "from omnibot_driver.tools.report import page\n"
        "from omnibot_driver.tools.report.__main__ import main\n"
        "page.PICTURES = page.PICTURES[:1]\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-c", program, str(bag)]
    try:
        done = subprocess.run(
            command, cwd=tmp_path, stdout=writer, stderr=subprocess.PIPE, text=True, check=False
        )
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Healthy." in (tmp_path / "bag_report/report.html").read_text()


def test_a_full_disk_for_the_output_is_told_in_one_sentence(
    drive: Drive,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The program's standard output goes to a full disk, but the report is already written.

    One line on stderr says that the output cannot be written, and where the report is.
    """
    bag = write(tmp_path / "bag", [drive])
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main([str(bag), "--output", str(tmp_path / "out")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "output cannot be written" in line
    assert line.endswith(f"the report is in {tmp_path}/out/report.html")


def test_a_terminal_that_knows_only_ascii_gets_the_verdict(
    drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The output is in ASCII. The report prints ? for other characters, such as ±."""
    bag, printed = write(tmp_path / "bag", [drive]), io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(printed, encoding="ascii"))
    assert main([str(bag), "--output", str(tmp_path / "out")]) in (0, 3)
    assert b"m/s?" in printed.getvalue()
