# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the report's page: it is self-contained, and its pictures show the available data."""

import re
from pathlib import Path

import numpy as np
import pytest
from drives import Drive
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.tools.report import page
from omnibot_driver.tools.report.drawing import POINTS, envelope
from omnibot_driver.tools.report.findings import span
from omnibot_driver.tools.report.judge import judge

PICTURES = ["imu", "path", "spectrum", "timeline", "timing", "velocities"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    drive = Drive(10.0)
    drive.estops += [(5.0, True), (6.0, False)]
    folder = tmp_path_factory.mktemp("page") / "of" / "a_drive"
    log = drive.log()
    page.write(log, judge(log), "<a & b>", folder)
    return folder


def test_the_page_has_everything_inside(folder: Path) -> None:
    """The page contains every picture as data, so it can be mailed and opened anywhere."""
    text = (folder / "report.html").read_text()
    addresses = re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"'>)]{0,30})""", text)
    assert len(addresses) == len(PICTURES)
    assert all(address.startswith("data:image/png;base64,") for address in addresses)
    assert "http" not in text
    assert "<script" not in text


def test_every_picture_lies_beside_the_page(folder: Path) -> None:
    """Each picture is also a PNG file of less than 200 kB beside the page."""
    assert sorted(file.stem for file in folder.glob("*.png")) == PICTURES
    for file in folder.glob("*.png"):
        assert file.read_bytes().startswith(b"\x89PNG")
        assert file.stat().st_size < 200_000


def test_a_name_cannot_become_markup(folder: Path) -> None:
    """The name of the bag has markup. The page shows it as plain text."""
    text = (folder / "report.html").read_text()
    assert "&lt;a &amp; b&gt;" in text
    assert "<a & b>" not in text


def test_every_finding_is_on_the_page_and_in_the_terminal(folder: Path) -> None:
    """The page and the terminal show the same findings."""
    drive = Drive(10.0)
    drive.estops += [(5.0, True), (6.0, False)]
    findings = judge(drive.log())
    told, shown = page.text(findings), (folder / "report.html").read_text()
    for finding in findings:
        assert finding.text in told
        assert finding.subject in shown
    assert "1 time, 1 s in all" in shown


def test_what_cannot_be_drawn_is_not_there(tmp_path: Path) -> None:
    """All values are NaN, so some pictures cannot be drawn.

    If an earlier report has left a file of such a picture, the file is removed.
    """
    drive = Drive(10.0)
    for topic in (drive.imu, drive.odom, drive.cmd_vel, drive.joints):
        topic.values[:] = np.nan
    (tmp_path / "path.png").write_bytes(b"old")
    log = drive.log()
    page.write(log, judge(log), "bag", tmp_path)
    drawn = {file.stem for file in tmp_path.glob("*.png")}
    assert {"timeline", "timing"} <= drawn
    assert not drawn & {"imu", "path", "spectrum"}


@given(st.integers(0, 40_000), st.integers(0, 2**32 - 1))
def test_an_envelope_keeps_the_extremes_and_the_order(length: int, seed: int) -> None:
    """``envelope`` reduces a long series to a limited number of points, and keeps its extremes."""
    values = np.random.default_rng(seed).normal(size=length)
    times_s = np.arange(length, dtype=float)
    shown_s, shown = envelope(times_s, values)
    assert len(shown) <= POINTS
    assert (np.diff(shown_s) >= 0.0).all()
    assert not length or (shown.min(), shown.max()) == (values.min(), values.max())


@pytest.mark.parametrize(
    ("seconds", "told"),
    [(0.02, "0.02 s"), (9.0, "9 s"), (99.6, "100 s"), (150.4, "2 min 30 s"), (7384, "2 h 03 min")],
)
def test_lengths_of_time_are_told_as_people_do(seconds: float, told: str) -> None:
    """Durations are shown in a short form: in s, in min and s, or in h and min."""
    assert span(seconds) == told
