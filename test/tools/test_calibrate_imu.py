# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate imu``: it finds planted sensor errors within its claimed uncertainties."""

import math
from pathlib import Path

import numpy as np
import pytest
from calibrate_rig import parameters_of, rig, row
from driver_process import Driver
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.tools.calibrate.allan import allan, noise
from omnibot_driver.tools.calibrate.files import draw
from omnibot_driver.tools.calibrate.imu import result
from omnibot_driver.tools.calibrate.log import Imu, Log
from omnibot_driver.tools.calibrate.rest import rest, still
from omnibot_driver.tools.needs import ToolError

PERIOD_S = 0.01
NOISE = np.array([0.001, 0.0009, 0.0012])
BIAS = np.array([0.02, -0.03, 0.01])
UPSIDE_DOWN = np.array([0.0, 0.0, -9.80665])


def sensor(seconds: float, seed: int = 0, force: np.ndarray = UPSIDE_DOWN, lost: int = 0) -> Imu:
    """Return IMU readings with bias, force and white noise.

    ``lost``: the number of readings that are missing in the middle.
    """
    random = np.random.default_rng(seed)
    count = round(seconds / PERIOD_S)
    rates = BIAS + NOISE * random.standard_normal((count, 3))
    forces = force + 0.03 * random.standard_normal((count, 3))
    stamps = np.arange(count + lost)[:count] * PERIOD_S
    stamps[count // 2 :] += lost * PERIOD_S
    return Imu(stamps, forces, rates)


def log_of(imu: Imu, moved_m: float = 0.0) -> Log:
    """Return a log of these IMU readings, and of an odometry that moves by ``moved_m`` in total."""
    rows = np.column_stack((imu.stamp_s, imu.force_mps2, imu.rate_radps))
    way = np.linspace(0.0, moved_m, len(rows) // 4)
    odometry = [(4 * n * PERIOD_S, x, 0.0, 0.0, 0.0, 0.0, 0.0) for n, x in enumerate(way)]
    return Log([tuple(map(float, one)) for one in rows], odometry)


def test_claimed_uncertainties_are_the_true_ones() -> None:
    """The bias is measured at rest, 100 times. The claimed uncertainties agree with the errors.

    An error divided by its claimed uncertainty has a standard deviation near 1.
    """
    rests = [rest(sensor(20.0, seed)) for seed in range(100)]
    biases = np.array([(one.bias_radps - BIAS) / one.bias_sigma for one in rests])
    assert 0.7 < biases.std() < 1.1
    densities = np.array([[n.density for n in one.noises] for one in rests])
    sigmas = np.array([[n.sigma for n in one.noises] for one in rests])
    planted = NOISE * math.sqrt(PERIOD_S)
    assert np.abs((densities - planted) / planted).max() < 0.1
    assert np.abs((densities - planted) / sigmas).mean() < 3


@settings(max_examples=30)
@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.sampled_from([0.0, math.pi]))
def test_level_is_the_turn_that_makes_gravity_point_up(
    roll: float, pitch: float, mounting: float
) -> None:
    """A tilted sensor rests.

    The roll and pitch that are found agree with the sensor's rotation matrix.
    """
    roll += mounting
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    to_body = np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])
    found = rest(sensor(2.0, force=to_body.T @ (0.0, 0.0, 9.8)))
    roll_rad, pitch_rad = found.level_rad
    assert abs(math.remainder(roll_rad - roll, math.tau)) < 0.003
    assert abs(pitch_rad - pitch) < 0.003
    assert np.allclose(to_body @ found.up, (0, 0, 1), atol=0.004)


def test_allan_deviation_tells_a_wandering_bias_from_noise() -> None:
    """An hour of readings has noise and a drifting bias.

    The Allan deviation gives the size of each.
    """
    random = np.random.default_rng(3)
    walk, density = 2e-5, 5e-4
    count, period_s = 36_000, 0.1
    readings = density / math.sqrt(period_s) * random.standard_normal(count)
    readings += np.cumsum(walk * math.sqrt(period_s) * random.standard_normal(count))
    found = noise(allan(readings, period_s))
    assert found.density == pytest.approx(density, rel=0.05)
    assert found.walk == pytest.approx(walk, rel=0.4)


@pytest.mark.parametrize(("seconds", "fitted"), [(50, False), (60, True)])
def test_a_minute_of_readings_is_enough_for_the_walk_of_a_bias(seconds: int, fitted: bool) -> None:
    """The bias drifts fast, and two readings are missing.

    A minute at rest, the default, is enough to show the drift, but 50 s are not.
    """
    random = np.random.default_rng(3)
    steps = 2e-3 * random.standard_normal(100 * seconds - 2)
    found = noise(allan(np.cumsum(steps), 0.01))
    assert (found.walk > 0.0) is fitted
    if fitted:
        assert found.walk == pytest.approx(2e-3 / math.sqrt(0.01), rel=0.3)


def test_a_bias_that_walks_is_known_less_well() -> None:
    """The bias drifts during a rest of ten minutes.

    The claimed uncertainty covers the bias at the end of the rest.
    """
    scores = []
    for seed in range(12):
        imu = sensor(600.0, seed)
        walk = np.cumsum(
            3e-6 * np.random.default_rng(seed).standard_normal(imu.rate_radps.shape), 0
        )
        found = rest(Imu(imu.stamp_s, imu.force_mps2, imu.rate_radps + walk))
        scores += list((found.bias_radps - BIAS - walk[-1]) / found.bias_sigma)
    assert 0.5 < np.std(scores) < 2.0


def test_a_long_rest_makes_a_moderate_picture(tmp_path: Path) -> None:
    """The picture of a long measurement omits points, so its file is smaller than 170 kB.

    With all points, the file would be larger, because noise does not compress well.
    """
    imu = sensor(120.0)
    picture = tmp_path / "imu.png"
    now = {name: parameter.default for name, parameter in PARAMETERS.by_name.items()}
    draw(result(rest(imu), imu, now, 9.80665), tmp_path / "robot.yaml", picture)
    assert picture.stat().st_size < 170_000


def test_readings_that_say_nothing_are_turned_away() -> None:
    """The readings are too few, not finite, stuck or interrupted.

    The tool rejects them with a message.
    """
    with pytest.raises(ToolError, match="too few"):
        rest(sensor(0.5))
    imu = sensor(3.0)
    imu.rate_radps[7, 1] = math.nan
    with pytest.raises(ToolError, match="not all finite"):
        rest(imu)
    imu = sensor(3.0)
    imu.force_mps2[:, 2] = -9.8
    with pytest.raises(ToolError, match="stuck"):
        rest(imu)
    with pytest.raises(ToolError, match="were lost"):
        rest(sensor(3.0, lost=30))


def test_a_robot_that_moves_is_not_at_rest() -> None:
    """The robot should rest, but its wheels turn, or its gyro shows too high a rate for a bias.

    The tool reports that the robot moves.
    """
    still(np.zeros(3))(log_of(sensor(3.0)))
    with pytest.raises(ToolError, match="its wheels turn"):
        still(np.zeros(3))(log_of(sensor(3.0), moved_m=0.02))
    with pytest.raises(ToolError, match="too much for a bias"):
        still(np.array([0.0, 0.0, 0.5]))(log_of(sensor(3.0)))


def test_planted_errors_are_found_and_the_driver_loads_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The IMU has a bias, noise and a tilt.

    ``calibrate imu`` finds them in 4 s through a real driver. Another driver loads the written
    file.
    """
    planted = (1.2, -0.8, 0.4)
    sensor = {
        "gyro_bias_dps": planted,
        "gyro_noise_dps": 0.08,
        "accel_bias_g": (0.0, 0.0, -0.02),
        "imu_rpy_rad": (math.radians(181.5), math.radians(-2.0), 0.0),
    }
    with rig(tmp_path, {"gyro_bias": [0.01, 0.0, 0.0]}, **sensor) as robot:
        robot.output.write_text("robot: number 7\n")
        assert robot.calibrate("imu", "--minutes", "0.066", "--apply") == 0
        written, table = robot.written(), capsys.readouterr().out
        assert parameters_of(robot.driver)["gyro_bias"] == written["gyro_bias"]
    for axis, dps in zip("xyz", planted, strict=True):
        value, sigma = row(table, f"gyro_bias {axis}")
        assert abs(value - math.radians(dps)) < 4 * sigma < math.radians(0.05)
    assert written["gyro_bias"] == pytest.approx([math.radians(v) for v in planted], abs=4e-4)
    assert written["angular_velocity_stddev"] == pytest.approx(math.radians(0.08), rel=0.15)
    assert written["accel_bias"][2] == pytest.approx(-0.02 * 9.80665, abs=0.02)
    assert row(table, "IMU roll")[0] == pytest.approx(181.5, abs=0.1)
    assert row(table, "IMU pitch")[0] == pytest.approx(-2.0, abs=0.1)
    assert row(table, "gyro noise density x")[0] == pytest.approx(0.008, rel=0.15)
    assert written["robot"] == "number 7"
    assert (tmp_path / "calibrate_imu.png").read_bytes().startswith(b"\x89PNG")
    with Driver(port="sim://", calibration_file=str(robot.output)) as driver:
        driver.wait_for_line("state: nominal")
        loaded = parameters_of(driver)
    assert {name: loaded[name] for name in written if name != "robot"} == {
        name: value for name, value in written.items() if name != "robot"
    }
