"""The guides against the code: no sentence it no longer says, no parameter it lacks."""

import ast
import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from omnibot_driver.core.kinematics import BodyTwist, OmniKinematics
from omnibot_driver.parameters import BY_NAME

ROOT = Path(__file__).parents[2]
TROUBLESHOOTING = ROOT / "docs/troubleshooting.md"
COMMISSIONING = ROOT / "docs/commissioning.md"
GAP = "…"
SENSES = {"clockwise": -1, "counter-clockwise": 1, "still": 0}


def templates() -> Iterator[str]:
    """Every string in the driver but docstrings, what is filled in shown as a gap."""
    for file in (ROOT / "omnibot_driver").rglob("*.py"):
        nodes = list(ast.walk(ast.parse(file.read_text())))
        docstrings = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        for node in nodes:
            if isinstance(node, ast.JoinedStr):
                yield "".join(
                    str(part.value) if isinstance(part, ast.Constant) else GAP
                    for part in node.values
                )
            elif isinstance(node, ast.Constant) and id(node) not in docstrings:
                yield str(node.value)


SAID = "\n".join(templates())
SENTENCES = re.findall(r"^\| `([^`]+)` \| .* \|$", TROUBLESHOOTING.read_text(), re.MULTILINE)
STATES = {"disconnected", "connecting", "paused", "nominal", "imu_only"}


@pytest.mark.parametrize("sentence", sorted(set(SENTENCES) - STATES))
def test_the_driver_still_says_it(sentence: str) -> None:
    """Each part between gaps and colons is in the code, word for word."""
    parts = [part.strip() for part in re.split(f"{GAP}|: ", sentence)]
    assert any(len(part) > 8 for part in parts)
    for part in parts:
        assert part in SAID


def test_every_state_is_explained() -> None:
    """And none besides."""
    assert set(SENTENCES) >= STATES
    assert all(state in SAID for state in STATES)


def test_every_assumption_has_its_step_and_what_mends_it() -> None:
    """The form at the end names steps of the guide and parameters of the driver."""
    text = COMMISSIONING.read_text()
    steps = set(re.findall(r"^## (\d)\. ", text, re.MULTILINE))
    form = re.findall(r"^\| (.+) \| (\d) \| (.+) \| \|$", text, re.MULTILINE)
    assert {step for _, step, _ in form} == steps
    named = {name for _, _, mends in form for name in re.findall(r"`(\w+)`", mends)}
    assert named - {"imu_rpy"} <= set(BY_NAME)


def test_the_wheels_turn_as_the_guide_says() -> None:
    """Counter-clockwise, seen from outside, is the manual's positive rate."""
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
