# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate geometry``, which finds the sizes of wheels and base by tape measure."""

import argparse
import io
import math
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibrate_bench import BenchRobot
from calibrate_rig import parameters_of, rig, row
from hypothesis import given, settings
from hypothesis import strategies as st
from surveyor import Surveyor

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.tools.calibrate import geometry
from omnibot_driver.tools.calibrate.arguments import command_line
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.geometry_fit import Reading, fit, rims_of, rolled
from omnibot_driver.tools.calibrate.log import Column
from omnibot_driver.tools.calibrate.waypoints import square
from omnibot_driver.tools.needs import ToolError

BASE_M = 0.143
DRIFT = 0.002
PERFECT = np.ones(3)
SIGMA = np.array([0.002, 0.002, math.radians(1.0)])


def arguments(*words: str) -> argparse.Namespace:
    return command_line().parse_args(["geometry", *words])


@cache
def paths() -> list[tuple[str, Column, bool]]:
    """Return all drives: name, exact path, and whether the user measures the final heading."""
    found = []
    for drive in geometry.plan(1.0, 3, squares=True):
        places = [Pose(), *drive.places]
        path = []
        for before, after in pairwise(places):
            for part in np.linspace(0, 1, 60):
                off = after - before
                path.append(before + off.times(part, part, part))
        rows = np.array([(one.x_m, one.y_m, one.yaw_rad) for one in path])
        found.append((drive.name, rows, drive.heading))
    return found


def readings(factors: Column, base: float, random: np.random.Generator) -> list[Reading]:
    """Return noisy tape readings of all drives of a robot with slip.

    ``factors``, ``base``: the robot's true sizes, relative to the sizes that the tool assumes.
    """
    made = []
    for name, path, heading in paths():
        rims = np.abs(rims_of(path, BASE_M))
        rough = DRIFT * random.standard_normal(rims.shape) / np.sqrt(np.maximum(rims, 1e-3))
        end = rolled(path, factors * (1 + rough), base, BASE_M)[
            -1
        ] + SIGMA * random.standard_normal(3)
        end[[0, 1] if heading else [2]] = math.nan
        made.append(Reading(name, path, end, SIGMA))
    return made


sizes = st.floats(0.93, 1.07)
unlike = st.floats(-0.01, 0.01)


@settings(max_examples=25)
@given(sizes, sizes, unlike, unlike, st.integers(0, 10_000))
def test_any_geometry_is_found_within_what_is_claimed(
    wheels: float, base: float, a: float, b: float, seed: int
) -> None:
    """Whatever the sizes of wheels and base, the fit finds them within five claimed sigmas."""
    factors = wheels * (1 + np.array([a, b, -a - b]))
    found = fit(readings(factors, base, np.random.default_rng(seed)), BASE_M, DRIFT)
    wheels_sigma, base_sigma = np.sqrt(np.diag(found.covariance))[:2]
    assert abs(found.wheels - wheels) < 5 * wheels_sigma < 0.02
    assert abs(found.base - base) < 5 * base_sigma < 0.02
    assert abs(found.turn - wheels / base) < 5 * found.turn_sigma < 0.01
    assert (np.abs(found.unlike - [a, b, -a - b]) < 5 * found.unlike_sigma).all()


def test_claimed_uncertainties_are_the_true_ones() -> None:
    """The sizes of 40 robots with slip are fitted. The claimed uncertainties agree with the errors.

    An error divided by its claimed uncertainty has a standard deviation near 1.
    """
    scores = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        found = fit(readings(1.03 * PERFECT, 0.98, random), BASE_M, DRIFT)
        wheels_sigma, base_sigma = np.sqrt(np.diag(found.covariance))[:2]
        scores.append(((found.wheels - 1.03) / wheels_sigma, (found.base - 0.98) / base_sigma))
    assert 0.6 < np.std(scores) < 1.2


@given(st.integers(0, 3))
def test_rolling_with_the_believed_sizes_is_the_way_itself(number: int) -> None:
    """``rolled`` with the assumed sizes returns the given path, moved to begin at the origin."""
    path = paths()[number + 2][1] + [3.0, -2.0, 0.0]
    assert rolled(path, PERFECT, 1.0, BASE_M) == pytest.approx(path - path[0], abs=1e-9)


def test_a_square_comes_back() -> None:
    """A square path ends where it began, with one full turn to the left or to the right."""
    for sign in (1, -1):
        last = square(1.0, sign)[-1]
        assert (last.x_m, last.y_m, last.yaw_rad) == pytest.approx((0, 0, sign * math.tau))


def test_readings_with_a_wrong_sign_are_turned_away() -> None:
    """The user's readings have a wrong sign. They are rejected, because no robot fits them."""
    wrong = readings(PERFECT, 1.0, np.random.default_rng(0))
    for one in wrong[2:4]:
        one.end[:2] *= -1
    with pytest.raises(ToolError, match="do not fit this robot"):
        fit(wrong, BASE_M, DRIFT)


@pytest.mark.parametrize(
    ("factors", "base", "slip"),
    [((1.025, 1.02, 1.015), 0.97, 0.0), ((0.98, 0.98, 0.98), 1.03, 0.01)],
)
def test_planted_sizes_are_found_on_the_simulated_robot(
    factors: tuple[float, float, float], base: float, slip: float
) -> None:
    """``calibrate geometry`` finds the sizes of a robot in simulated time.

    If the wheels slip, the test expects a smaller wheel radius. The result does not depend on the
    driver's parameters.
    """
    robot = BenchRobot(wheel_radius_scale=factors, base_radius_scale=base, slip=slip)
    robot.parameters |= {"wheel_radius": 0.03, "base_radius": 0.15}
    console = Console(read=Surveyor(lambda: robot.bench.board), file=io.StringIO())
    quickly = ("--speed", "0.4", "--turning", "1.0")
    found = geometry.run(robot, console, arguments(*quickly, "--turns", "1", "--side", "0.4"))
    mean = sum(factors) / 3 * (1 - slip)
    planted = {
        "wheel_radius": 0.029 * mean,
        "base_radius": 0.143 * base,
        "odom_linear_scale": mean,
        "odom_angular_scale": mean / base,
    }
    for one in found.findings[:4]:
        assert one.sigma is not None
        assert abs(one.value - planted[one.name]) < max(4 * one.sigma, 0.002 * planted[one.name])
        assert one.sigma < 0.01 * planted[one.name]
        assert found.parameters[one.name] == one.value


def test_sizes_that_were_found_are_those_believed_next_time() -> None:
    """A second calibration begins with the sizes that the first one has found."""
    now = {name: parameter.default for name, parameter in PARAMETERS.by_name.items()}
    found = {
        "wheel_radius": 0.029 * 1.02,
        "base_radius": 0.143 * 0.97,
        "odom_linear_scale": 1.02,
        "odom_angular_scale": 1.02 / 0.97,
    }
    assert geometry.believed(now | found) == pytest.approx(found)
    counts = {"delta_frame": "wheel_counts", "wheel_radius": 0.03, "base_radius": 0.15}
    assert geometry.believed(now | counts) == {"wheel_radius": 0.03, "base_radius": 0.15}


def test_planted_sizes_are_found_through_a_driver_and_applied(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot has other sizes than usual. ``calibrate geometry`` finds them through a real driver.

    ``--apply`` sets them in the driver.
    """
    quick = {"max_angular_speed": 2.5}
    planted: dict[str, Any] = {"wheel_radius_scale": (1.04,) * 3, "base_radius_scale": 0.97}
    with rig(tmp_path, quick, **planted) as robot:
        words = ("--side", "0.3", "--turns", "1", "--turning", "2.5", "--speed", "0.4")
        surveyor = Surveyor(lambda: robot.port.board)
        code = robot.calibrate("geometry", *words, "--without-squares", "--apply", answer=surveyor)
        assert code == 0
        written, table = robot.written(), capsys.readouterr().out
        applied = parameters_of(robot.driver)
    for name, value in (("wheel_radius", 0.029 * 1.04), ("base_radius", 0.143 * 0.97)):
        found, sigma = row(table, name)
        assert abs(found - value) < max(4 * sigma, 0.005 * value)
        assert sigma < 0.02 * value
    assert written["odom_angular_scale"] == pytest.approx(1.04 / 0.97, rel=0.005)
    assert {name: applied[name] for name in written} == written
