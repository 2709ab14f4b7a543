# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that a finished measurement is kept if its result cannot be drawn, saved or printed."""

import io
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from omnibot_driver import boards, calibration
from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.tools.calibrate import connection, imu
from omnibot_driver.tools.calibrate.__main__ import main
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.result import Finding, Result

FOUND = {"linear_scale": 71.3}

Ending = Callable[..., int]


def fine(figure: Any) -> None:
    figure.subplots().plot([1, 2])


def failing(_figure: Any) -> None:
    raise ValueError("a picture that cannot be drawn")


def failing_late(figure: Any) -> None:
    """Draw a title with an invalid formula. Matplotlib rejects the title when it saves the file."""
    figure.subplots().set_title("$\\frac{$")


@pytest.fixture
def ending(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Ending:
    """Return a function that runs ``calibrate imu`` without a robot, and returns the exit code.

    The result of the calibration is given by the arguments ``draw`` and ``found`` of the function.
    """

    @contextmanager
    def connect(
        _namespace: str, _arguments: object, interruption: Interruption
    ) -> Iterator[SimpleNamespace]:
        def interrupted(_values: object) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            interruption.check()

        yield SimpleNamespace(
            parameters=boards.check_all({}),
            table=PARAMETERS,
            driver="/omnibot_driver",
            apply=interrupted,
        )

    def end(
        *words: str,
        draw: Callable[[Any], None] = fine,
        found: dict[str, float] = FOUND,
        folder: Path = tmp_path,
    ) -> int:
        findings = [Finding(name=name, value=value) for name, value in found.items()]
        result = Result(findings=findings, parameters=found, draw=draw)
        monkeypatch.setattr(imu, "run", lambda *_: result)
        files = ["--output", str(folder / "robot.yaml"), "--plot", str(tmp_path / "imu.svg")]
        return main(["imu", *files, *words])

    monkeypatch.setattr(connection, "connect", connect)
    return end


def test_all_is_well(ending: Ending, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The result of a calibration is printed, saved and drawn."""
    assert ending() == 0
    assert calibration.load(tmp_path / "robot.yaml", PARAMETERS) == FOUND
    assert "<svg" in (tmp_path / "imu.svg").read_text()
    assert "71.3" in capsys.readouterr().out


@pytest.mark.parametrize("draw", [failing, failing_late])
def test_a_picture_that_cannot_be_drawn_costs_the_picture_alone(
    draw: Callable[[Any], None], ending: Ending, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The picture cannot be drawn. The result is still saved, and the error message states this."""
    assert ending(draw=draw) == 1
    assert calibration.load(tmp_path / "robot.yaml", PARAMETERS) == FOUND
    said = capsys.readouterr()
    assert (
        f"saved to {tmp_path}/robot.yaml, but the picture {tmp_path}/imu.svg is not drawn: "
        in said.err
    )
    assert "71.3" in said.out


def test_a_file_that_cannot_be_written_costs_the_file_alone(
    ending: Ending, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The file cannot be written. The table is still printed, so the user can copy the values."""
    assert ending(found={"linear_scale": 1e9}) == 1
    assert not (tmp_path / "robot.yaml").exists()
    said = capsys.readouterr()
    assert "parameter 'linear_scale' must be" in said.err
    assert "1e+09" in said.out


def test_an_interruption_after_the_result_is_saved_says_where_it_is(
    ending: Ending, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The user presses ctrl-C while ``--apply`` sets the parameters. The file is written already.

    The message contains the path of the file.
    """
    assert ending("--apply") == 130
    assert calibration.load(tmp_path / "robot.yaml", PARAMETERS) == FOUND
    assert f"and the result is saved to {tmp_path}/robot.yaml" in capsys.readouterr().err


def test_a_broken_pipe_loses_nothing(
    ending: Ending, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reader of stdout is gone before the table is printed. The result is still saved."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as gone:
        monkeypatch.setattr(sys, "stdout", gone)
        assert ending() == 1
    assert calibration.load(tmp_path / "robot.yaml", PARAMETERS) == FOUND


def test_a_full_disk_for_the_output_loses_nothing(
    ending: Ending,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The program's standard output goes to a full disk, but the calibration file is still saved.

    One sentence on stderr says why the program ends.
    """
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert ending() == 1
    assert calibration.load(tmp_path / "robot.yaml", PARAMETERS) == FOUND
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("calibrate: the output cannot be written: ")


def test_a_terminal_that_knows_only_ascii_gets_the_result(
    ending: Ending, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The output is in ASCII. The table has ? for other characters, such as ±."""
    printed = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(printed, encoding="ascii"))
    assert ending() == 0
    assert b"71.3" in printed.getvalue()


def test_what_is_to_be_copied_stands_on_one_line(
    ending: Ending, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A parameter that the user should copy is printed on one line, even if its path is long."""
    folder = tmp_path / ("a_long_name_" * 12)
    assert ending(folder=folder) == 0
    assert f"  -p calibration_file:={folder}/robot.yaml" in capsys.readouterr().out.splitlines()
