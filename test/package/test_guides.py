# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the guides agree with the code: every message and parameter in them exists."""

import ast
import gc
import math
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.twist import BodyTwist

ROOT = Path(__file__).parents[2]
TROUBLESHOOTING = ROOT / "docs/troubleshooting.md"
COMMISSIONING = ROOT / "docs/commissioning.md"
DIAGNOSTICS = ROOT / "docs/diagnostics.md"
TOUR = ROOT / "docs/tools/tour.md"
GAP = "…"
SENSES = {"clockwise": -1, "counter-clockwise": 1, "still": 0}


def text_of(node: ast.AST) -> str:
    """Return the text of a string node, with "…" in place of each inserted value.

    For other nodes, return "".
    """
    if isinstance(node, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.Constant) else GAP for part in node.values]
        return "".join(map(str, parts))
    return str(node.value) if isinstance(node, ast.Constant) else ""


@cache
def code() -> dict[Path, list[ast.AST]]:
    """Return all syntax nodes of each module of the driver.

    Garbage collection is switched off during this call. It would take 1 s and find nothing.
    """
    files = (ROOT / "omnibot_driver").rglob("*.py")
    gc.disable()
    try:
        return {file: list(ast.walk(ast.parse(file.read_text()))) for file in files}
    finally:
        gc.enable()


@cache
def said() -> str:
    """Return all strings of the driver except docstrings, one per line."""
    texts: list[str] = []
    for nodes in code().values():
        docstrings = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        texts += (text_of(node) for node in nodes if id(node) not in docstrings)
    return "\n".join(texts)


def told() -> Iterator[str]:
    """Yield the messages of the driver's refusals and warnings."""
    for file, nodes in code().items():
        if {"simulator", "demo", "tools"} & set(file.parts):
            continue
        for node in nodes:
            if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in TELLING:
                yield from {text for text in map(text_of, node.args) if text} - WRAPPERS


GAPS = re.compile(f"{GAP}|: ")
TELLING = {
    *("CommandRefused", "LinkError", "Notice", "NoticeReading", "ParameterError", "RequestRefused"),
    *("_notice", "_once", "warning"),
}
"""Functions and classes whose argument is a message to the user."""
WRAPPERS = {"… (reported once)", "… (…)"}
"""Messages that only wrap another message. They need no row in the troubleshooting guide."""
SENTENCES = re.findall(r"^\| `([^`]+)` \| .* \|$", TROUBLESHOOTING.read_text(), re.MULTILINE)
STATES = {"disconnected", "connecting", "paused", "nominal", "imu_only"}


@pytest.mark.parametrize("sentence", sorted(set(SENTENCES) - STATES))
def test_the_driver_still_says_it(sentence: str) -> None:
    """Each message that the troubleshooting guide quotes is in the driver's code.

    Gaps ("…") and colons separate the parts of a message. Each part is searched for by itself.
    """
    parts = [part.strip() for part in GAPS.split(sentence)]
    assert any(len(part) > 8 for part in parts)
    for part in parts:
        assert part in said(), "docs/troubleshooting.md quotes words that are not in the code"


def test_what_the_driver_tells_is_explained() -> None:
    """The troubleshooting guide has a row for each message of the driver.

    The row contains the beginning of the message, or quotes parts of the message.
    """

    def is_explained(template: str) -> bool:
        begin = next((part for part in template.split(GAP) if len(part) > 9), template)
        return any(
            begin in sentence or all(part.strip() in template for part in GAPS.split(sentence))
            for sentence in set(SENTENCES) - STATES
        )

    without = [template for template in sorted(set(told())) if not is_explained(template)]
    assert not without, "please add rows to docs/troubleshooting.md for:\n" + "\n".join(without)


def test_every_state_is_explained() -> None:
    """The table of the troubleshooting guide has a row for each state of the driver."""
    assert set(SENTENCES) >= STATES
    assert all(state in said() for state in STATES)


def test_every_status_of_the_diagnostics_has_its_row() -> None:
    """docs/diagnostics.md has a row for each diagnostic status, in the order of publication."""
    code = (ROOT / "omnibot_driver/core/reporting/diagnosis.py").read_text()
    names = dict.fromkeys(re.findall(r'Status\(\s*"([\w-]+)"', code))
    rows = re.findall(r"^\| ([\w-]+) \|", DIAGNOSTICS.read_text(), re.MULTILINE)
    assert rows[:1] == ["Status"]
    assert rows[1 : 1 + len(names)] == list(names)


def test_the_tour_shows_what_the_driver_says() -> None:
    """Each warning and error in the tour is a message of the driver.

    Only inserted values may differ.
    """
    patterns = [
        re.compile(".*".join(map(re.escape, template.split(GAP))))
        for template in said().splitlines()
        if len(template.replace(GAP, "")) > 15
    ]
    lines = re.findall(r"^\[(?:WARN|ERROR)\] \S+ (.+)$", TOUR.read_text(), re.MULTILINE)
    assert len(lines) > 8
    for line in lines:
        assert any(pattern.search(line) for pattern in patterns), line


def test_every_assumption_has_its_step_and_what_mends_it() -> None:
    """The commissioning guide's form lists all steps of the guide, and only parameters that exist.

    The only exception is ``imu_rpy``, a parameter of the robot's description.
    """
    text = COMMISSIONING.read_text()
    steps = set(re.findall(r"^## (\d)\. ", text, re.MULTILINE))
    form = re.findall(r"^\| (.+) \| (\d) \| (.+) \| \|$", text, re.MULTILINE)
    assert {step for _, step, _ in form} == steps
    named = {name for _, _, corrects in form for name in re.findall(r"`(\w+)`", corrects)}
    assert named - {"imu_rpy"} <= set(PARAMETERS.by_name)


def test_the_wheels_turn_as_the_guide_says() -> None:
    """The commissioning guide says how each wheel turns for a command. The kinematics agree.

    A positive rate is counter-clockwise, seen from outside the robot.
    """
    kinematics = OmniKinematics(wheel_radius_m=0.029, base_radius_m=0.143)
    expected = {
        "linear: {x": kinematics.wheel_rates(BodyTwist(1.0, 0.0, 0.0)),
        "linear: {y": kinematics.wheel_rates(BodyTwist(0.0, 1.0, 0.0)),
        "angular: {z": kinematics.wheel_rates(BodyTwist(0.0, 0.0, 1.0)),
    }
    for command, rates in expected.items():
        pattern = rf"^\| `say '{{{command}.+?` \| (\w.+) \|$"
        row = re.search(pattern, COMMISSIONING.read_text(), re.MULTILINE)
        assert row
        said = [SENSES[cell.split(",")[0].strip()] for cell in row[1].split("|")]
        assert said == [math.copysign(abs(rate) > 1e-9, rate) for rate in rates]
