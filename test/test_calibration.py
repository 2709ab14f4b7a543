# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the calibration file.

A save is complete or changes nothing, and it keeps the other entries of the file.
"""

import os
import stat
from pathlib import Path

import pytest
import yaml

from omnibot_driver import calibration
from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.errors import ParameterError

BIAS = [0.01, -0.02, 0.03]


@pytest.mark.parametrize("bias", [BIAS, [1 / 3, -1e-9, 1.0], [0.0, -0.0, 5e-324]])
def test_what_is_saved_is_loaded_exactly(tmp_path: Path, bias: list[float]) -> None:
    """Loaded values equal the saved values to the last digit."""
    path = tmp_path / "robot.yaml"
    calibration.save(path, {"gyro_bias": bias})
    assert calibration.load(path, PARAMETERS) == {"gyro_bias": bias}


def test_without_a_file_there_is_no_calibration(tmp_path: Path) -> None:
    """A missing file or an empty file contains no calibration.

    If the folder of the file is missing, a save makes the folder.
    """
    path = tmp_path / "new" / "robot.yaml"
    assert calibration.load(path, PARAMETERS) == {}
    calibration.save(path, {"gyro_bias": BIAS})
    path.write_text("")
    assert calibration.load(path, PARAMETERS) == {}


def test_other_names_in_the_file_stay(tmp_path: Path) -> None:
    """A save changes one entry of the file. The other entries stay, and so does their order."""
    path = tmp_path / "robot.yaml"
    path.write_text("robot: no. 7\ngyro_bias: [0, 0, 0]\naccel_bias: [1, 2, 3]\n")
    assert calibration.load(path, PARAMETERS) == {
        "gyro_bias": [0.0] * 3,
        "accel_bias": [1.0, 2.0, 3.0],
    }
    calibration.save(path, {"gyro_bias": BIAS})
    content = yaml.safe_load(path.read_text())
    assert list(content.items()) == [
        ("robot", "no. 7"),
        ("gyro_bias", BIAS),
        ("accel_bias", [1, 2, 3]),
    ]


@pytest.mark.parametrize(
    "text",
    ["gyro_bias: [1, 2", "- 1\n- 2\n", "just words", "gyro_bias: 1", "gyro_bias: [0, 0, 99]",
     "accel_bias: [a, b, c]", "gyro_bias: null", "\udcff"],
)  # fmt: skip
def test_a_file_that_makes_no_sense_is_an_error_that_says_what_to_do(
    tmp_path: Path, text: str
) -> None:
    """The file is invalid. The error names the file and says what to do."""
    path = tmp_path / "robot.yaml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ParameterError, match="correct the file or the path, or remove") as caught:
        calibration.load(path, PARAMETERS)
    assert str(path) in str(caught.value)


def test_a_folder_is_not_a_file(tmp_path: Path) -> None:
    """The calibration file cannot be read, because its path leads to a folder. An error says so."""
    with pytest.raises(ParameterError, match=r"cannot be read \(Is a directory\): correct the"):
        calibration.load(tmp_path, PARAMETERS)


def test_a_pipe_or_a_device_is_not_a_file(tmp_path: Path) -> None:
    """The path leads to a pipe, which has no end, or to a device, which a save would replace.

    An error says so. The pipe is not read and not replaced.
    """
    path = tmp_path / "pipe"
    os.mkfifo(path)
    for use in (
        lambda: calibration.load(path, PARAMETERS),
        lambda: calibration.save(path, {"gyro_bias": BIAS}),
    ):
        with pytest.raises(ParameterError, match="not a file, but a device or a pipe: give anoth"):
            use()
    assert path.is_fifo()
    with pytest.raises(ParameterError, match="/dev/null is not a file"):
        calibration.load(Path("/dev/null"), PARAMETERS)


def test_a_path_that_cannot_be_examined_is_reported(tmp_path: Path) -> None:
    """The system refuses to examine the path, e.g. because its name is too long. An error says so.

    The same error appears if the user may not enter the folder.
    """
    with pytest.raises(ParameterError, match=r"cannot be read .*too long"):
        calibration.load(tmp_path / ("x" * 300), PARAMETERS)


def test_a_save_that_fails_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full during a save. The old file stays, and no other file is left behind."""
    path = tmp_path / "robot.yaml"
    calibration.save(path, {"gyro_bias": BIAS})

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        calibration.save(path, {"gyro_bias": [0.0, 0.0, 0.0]})
    assert calibration.load(path, PARAMETERS) == {"gyro_bias": BIAS}
    assert list(tmp_path.iterdir()) == [path]


def test_others_may_read_the_file(tmp_path: Path) -> None:
    """Every user may read a saved file.

    The default of ``mkstemp`` would allow this only to the owner.
    """
    path = tmp_path / "robot.yaml"
    calibration.save(path, {"gyro_bias": BIAS})
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_a_symbolic_link_stays_one(tmp_path: Path) -> None:
    """The file is a symbolic link.

    A save changes the file to which it points, and the link stays.
    """
    path, link = tmp_path / "far" / "robot.yaml", tmp_path / "robot.yaml"
    link.symlink_to(path)
    calibration.save(link, {"gyro_bias": BIAS})
    assert link.is_symlink()
    assert calibration.load(path, PARAMETERS) == {"gyro_bias": BIAS}
    assert list(path.parent.iterdir()) == [path]


def test_a_home_that_nobody_has_is_refused() -> None:
    """The driver replaces ``~`` with the user's home folder.

    The home folder of an unknown user is refused.
    """
    assert calibration.locate("~/robot.yaml") == Path.home() / "robot.yaml"
    with pytest.raises(
        ParameterError, match="home folder in this path does not exist; give the full"
    ):
        calibration.locate("~nosuchuser/robot.yaml")
