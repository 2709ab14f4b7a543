# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what ``calibrate commission`` concludes from wheel patterns, IMU postures and drifts.

A drift is the mean velocity of the robot over a time span.
"""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from omnibot_driver.tools.calibrate.log import Imu, Odometry
from omnibot_driver.tools.calibrate.meaning import (
    Drift,
    control_method,
    deltas_are_understood,
    drift,
    frame_is_right,
    require_motion,
)
from omnibot_driver.tools.calibrate.mounting import mounting, require_left_turn, rpy, up
from omnibot_driver.tools.calibrate.seen import (
    Contradiction,
    axis_sign,
    mirrored,
    understand,
    wanted,
    wheel_sign,
)
from omnibot_driver.tools.needs import ToolError

angles = st.floats(-math.pi, math.pi)
tilts = st.floats(math.radians(15), math.radians(60))
PATTERNS = list(product((1, 0, -1), repeat=3))


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return the rotation matrix of roll, pitch and yaw (in rad) about fixed axes."""
    about_x = [[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]
    about_y = [
        [math.cos(pitch), 0, math.sin(pitch)],
        [0, 1, 0],
        [-math.sin(pitch), 0, math.cos(pitch)],
    ]
    about_z = [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    return np.array(about_z) @ np.array(about_y) @ np.array(about_x)


def postures(mounted: np.ndarray, nose_rad: float, left_rad: float) -> list[np.ndarray]:
    """Return the upward direction in the axes of the mounted sensor, for three postures.

    The postures are level, front raised by ``nose_rad``, and left side raised by ``left_rad``.
    """
    bodies = (
        (0.0, 0.0, 1.0),
        (math.sin(nose_rad), 0.0, math.cos(nose_rad)),
        (0.0, math.sin(left_rad), math.cos(left_rad)),
    )
    return [mounted.T @ np.array(body) for body in bodies]


# Patterns that the user sees


def test_the_table_of_the_commissioning_guide_is_what_is_wanted() -> None:
    """``wanted`` returns the signs of the wheels that the commissioning guide has in its table.

    The test contains a copy of this table.
    """
    assert [wanted(axis) for axis in range(3)] == [(-1, 1, 0), (-1, -1, 1), (-1, -1, -1)]


@pytest.mark.parametrize("answer", ["+0-", "+ 0 -", "+,0,-", " +, 0, - "])
def test_three_signs_are_understood(answer: str) -> None:
    """``understand`` accepts three signs of wheel directions with or without spaces and commas."""
    assert understand(answer) == (1, 0, -1)


@pytest.mark.parametrize("answer", ["", "+", "++", "+0-+", "abc", "1 0 -1", "yes"])
def test_what_is_not_three_signs_is_not_understood(answer: str) -> None:
    """``understand`` returns None for an answer that does not consist of three signs."""
    assert understand(answer) is None


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("wheel", range(3))
def test_a_wheel_is_itself_or_it_is_a_contradiction(
    wheel: int, pattern: tuple[int, int, int]
) -> None:
    """One wheel is commanded, and the user answers with one of the 27 patterns of wheel directions.

    A pattern in which only this wheel turns is valid. All others are contradictions.
    """
    alone = tuple(int(n == wheel) for n in range(3))
    if pattern in (alone, tuple(-n for n in alone)):
        assert wheel_sign(wheel, pattern) == sum(pattern)
    else:
        with pytest.raises(Contradiction, match="wheel"):
            wheel_sign(wheel, pattern)


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("axis", range(3))
def test_an_axis_is_right_or_reversed_or_it_is_a_contradiction(
    axis: int, pattern: tuple[int, int, int]
) -> None:
    """A pattern of wheel directions gives an axis the sign 1 or -1, or is a contradiction.

    The pattern in the commissioning guide gives 1, and its reverse gives -1.
    """
    expected = wanted(axis)
    if pattern == expected:
        assert axis_sign(axis, pattern) == 1
    elif pattern == tuple(-n for n in expected):
        assert axis_sign(axis, pattern) == -1
    else:
        with pytest.raises(Contradiction, match="is neither"):
            axis_sign(axis, pattern)


def test_one_reversed_axis_is_a_mirror_image_two_are_a_turn() -> None:
    """If one axis is reversed, the signs describe a mirror image of the robot.

    If x and y are reversed, they describe a robot that is turned by 180°.
    """
    assert not mirrored((1, 1, 1))
    assert not mirrored((-1, -1, 1))
    assert mirrored((-1, 1, 1))


# Mounting by gravity


@given(angles, st.floats(-1.5, 1.5), angles, tilts, tilts)
def test_any_mounting_is_found_from_three_postures(
    roll: float, pitch: float, yaw: float, nose_rad: float, left_rad: float
) -> None:
    """Whatever the mounting of the sensor, it is found exactly.

    The angles of the two tilts do not matter.
    """
    planted = rotation(roll, pitch, yaw)
    found = mounting(*postures(planted, nose_rad, left_rad))
    assert found.rotation == pytest.approx(planted, abs=1e-6)
    assert found.tilts_rad == pytest.approx((nose_rad, left_rad))


@given(angles, st.floats(-1.5, 1.5), angles)
def test_angles_are_those_of_a_description(roll: float, pitch: float, yaw: float) -> None:
    """Roll, pitch and yaw are computed from a rotation matrix. They give the same matrix again."""
    made = rotation(roll, pitch, yaw)
    assert rotation(*rpy(made)) == pytest.approx(made, abs=1e-9)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_a_sensor_on_its_edge_has_angles_too(pitch: float) -> None:
    """The pitch is 90°, so roll and yaw have the same axis.

    One of the many solutions is returned.
    """
    made = rotation(0.3, pitch, 0.4)
    assert rotation(*rpy(made)) == pytest.approx(made, abs=1e-9)


@settings(max_examples=40)
@given(
    st.tuples(st.sampled_from([0, math.pi]), st.just(0), st.sampled_from([0, 1, 2, 3])),
    st.lists(st.floats(-0.09, 0.09), min_size=4, max_size=4),
)
def test_a_clumsy_hand_still_finds_right_angles(
    mounted: tuple[float, float, int], slips: list[float]
) -> None:
    """The user's tilts are askew by up to 5°.

    The tool still finds which of the 24 right-angled mountings the sensor has.
    """
    planted = rotation(mounted[0], mounted[1], mounted[2] * math.pi / 2)
    level = postures(planted, 0.5, 0.6)[0]
    body_nose = rotation(slips[0], 0, slips[1]) @ np.array([math.sin(0.5), 0, math.cos(0.5)])
    body_left = rotation(0, slips[2], slips[3]) @ np.array([0, math.sin(0.6), math.cos(0.6)])
    snapped = mounting(level, planted.T @ body_nose, planted.T @ body_left).snapped()
    assert snapped is not None
    assert snapped.rotation == pytest.approx(planted, abs=1e-9)


def test_a_sensor_mounted_askew_stays_so() -> None:
    """A sensor is mounted with a yaw of 30°. The tool does not round this to a right angle."""
    assert mounting(*postures(rotation(math.pi, 0, math.pi / 6), 0.5, 0.5)).snapped() is None


@pytest.mark.parametrize(("nose_rad", "left_rad"), [(-0.5, 0.5), (0.5, -0.5)])
def test_a_side_lowered_instead_of_raised_is_a_contradiction(
    nose_rad: float, left_rad: float
) -> None:
    """A tilt in the wrong direction is a contradiction: the computed axes would be left-handed."""
    level, nose_up, left_up = postures(rotation(math.pi, 0, 0), nose_rad, left_rad)
    with pytest.raises(Contradiction, match="repeat both tilts"):
        mounting(level, nose_up, left_up)


@pytest.mark.parametrize("tilt_rad", [0.05, 1.5])
def test_a_tilt_that_is_none_is_a_contradiction(tilt_rad: float) -> None:
    """The user tilts the robot by 3°, which is too little, or by 86°, which is too much.

    Both are rejected.
    """
    with pytest.raises(Contradiction, match="front was raised"):
        mounting(*postures(np.eye(3), tilt_rad, 0.5))


def resting(
    force: tuple[float, float, float], rate: tuple[float, float, float], seconds: float
) -> Imu:
    """Return IMU readings with a constant force and a constant rate. They last ``seconds``."""
    stamps = np.arange(0.0, seconds, 0.01)
    return Imu(stamps, np.tile(force, (len(stamps), 1)), np.tile(rate, (len(stamps), 1)))


def test_a_turn_by_hand_is_to_the_left_by_enough() -> None:
    """A turn by hand is accepted only if it is to the left and large enough.

    ``require_left_turn`` returns the turn in rad, without the gyro's bias, or raises Contradiction.
    """
    level, bias = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 0.1])

    def turned(rate: float) -> float:
        return require_left_turn(resting((0, 0, -9.8), (0.0, 0.0, rate), 4.0), bias, level)

    assert turned(-0.4) == pytest.approx(0.5 * 3.99)
    with pytest.raises(Contradiction, match="to the right"):
        turned(0.6)
    with pytest.raises(Contradiction, match="by only"):
        turned(0.0)


def test_what_is_not_held_still_or_not_gravity_is_said() -> None:
    """A measurement of gravity is rejected in three cases.

    The robot was not held still, the gravity has the wrong size, or no reading was received.
    """
    shaking = resting((0.0, 0.0, 9.8), (0.0, 0.0, 0.0), 1.0)
    shaking.rate_radps[::2] = 0.5
    with pytest.raises(Contradiction, match="not held still"):
        up(shaking)
    with pytest.raises(Contradiction, match="accel_range"):
        up(resting((0, 0, 19.6), (0, 0, 0), 1.0))
    with pytest.raises(Contradiction, match="no reading"):
        up(resting((0, 0, 9.8), (0, 0, 0), 0.0))


# Meaning of the deltas


def steady(vx: float, vy: float = 0.0, yaw_rate: float = 0.0) -> Drift:
    """Return the measured motion (``Drift``) of a robot that moves at this constant velocity.

    ``vx`` and ``vy`` are in m/s, ``yaw_rate`` in rad/s.
    """
    return Drift(vx, vy, yaw_rate, math.hypot(vx, vy), math.hypot(vx, vy))


@given(st.floats(0.3, 3.0), angles)
def test_velocities_are_held_and_doubled(scale: float, direction_rad: float) -> None:
    """If a command is doubled and the robot drives twice as fast, the tool finds velocity control.

    The unit of the command and its direction do not matter.
    """
    x, y = 0.06 * scale * math.cos(direction_rad), 0.06 * scale * math.sin(direction_rad)
    assert control_method(steady(x, y), steady(2 * x, 2 * y), 0.06) == "velocity"


@pytest.mark.parametrize(
    ("slow", "fast"),
    [
        (steady(0.0), steady(0.0)),  # arrived at once
        (steady(0.3), steady(0.3)),  # far from its target, and still on its way
        (Drift(0.02, 0.0, 0.0, 0.05, 0.0), steady(0.0)),  # arriving
        (steady(0.06), Drift(0.09, 0.0, 0.0, 0.18, 0.02)),
    ],
)
def test_a_pose_is_driven_to_and_no_further(slow: Drift, fast: Drift) -> None:
    """The tool finds positional control if a doubled command does not make the robot faster.

    The tool also finds positional control if the robot stops at a goal. In both cases, the board
    takes commands as positions.
    """
    assert control_method(slow, fast, 0.06) == "position"


@pytest.mark.parametrize(
    ("slow", "fast"),
    [
        (steady(0.06), Drift(0.09, 0.0, 0.0, 0.06, 0.12)),  # the second command came late
        (Drift(0.03, 0.0, 0.0, 0.01, 0.06), steady(0.12)),  # the first command came late
        (steady(0.06), Drift(0.08, 0.0, 0.0, 0.12, 0.04)),  # the robot was stopped too early
        (steady(0.06), steady(0.2)),
    ],
)
def test_a_disturbed_motion_shows_nothing(slow: Drift, fast: Drift) -> None:
    """If a motion fits neither velocity control nor positional control, the tool finds neither.

    For example, a command comes late, so the robot becomes faster during the measurement.
    """
    assert control_method(slow, fast, 0.06) is None


@given(angles, st.floats(0.9, 2.0), st.sampled_from([-1, 1]))
def test_the_wrong_frame_turns_with_the_robot(
    direction_rad: float, turned_rad: float, side: int
) -> None:
    """Two equal commands, before and after a turn, show whether the assumed delta frame is right.

    * The two motions have the same direction in the body's axes: right.
    * Their directions differ by the angle of the turn: wrong.
    * Any other difference: ToolError.
    """

    def heading(rad: float) -> Drift:
        return steady(0.1 * math.cos(rad), 0.1 * math.sin(rad))

    before = heading(direction_rad)
    assert frame_is_right(before, heading(direction_rad + 0.05), turned_rad)
    assert not frame_is_right(before, heading(direction_rad + side * turned_rad), turned_rad)
    assume(1.5 * turned_rad + 0.36 * turned_rad < math.tau - 1.4 * turned_rad)
    with pytest.raises(ToolError, match="contradicts itself"):
        frame_is_right(before, heading(direction_rad + 1.5 * turned_rad), turned_rad)


def test_a_turn_on_the_spot_shows_what_deltas_are() -> None:
    """The odometry of a turn on the spot shows whether the driver interprets deltas correctly.

    If the driver confuses displacements with wheel counts, the odometry also shows linear motion.
    """
    # In 40 ms at 0.5 rad/s, the robot turns by 20 mrad, and each wheel by 24 counts.
    rim = math.tau * 0.029 / 1560
    as_displacements = steady(24e-4 / 0.04, 24e-4 / 0.04, 24e-4 / 0.04)
    as_counts = steady(0.0, 2 / 3 * 200 * rim / 0.04, -200 * rim / 0.04 / (3 * 0.143))
    assert deltas_are_understood(steady(0.001, 0.001, 0.5), 0.143)
    assert not deltas_are_understood(as_displacements, 0.143)
    assert not deltas_are_understood(as_counts, 0.143)


def test_a_drift_is_of_its_time_alone() -> None:
    """``drift`` computes the velocity only from the odometry between the two given times.

    ``drift`` raises an error without such odometry; ``require_motion`` raises one without motion.
    """
    stamps = np.arange(0.0, 4.0, 0.04)
    twist = np.zeros((100, 3))
    twist[50:, 0] = 0.2
    odometry = Odometry(stamps, np.zeros((100, 3)), twist)
    assert drift(odometry, 2.2, 4.0).speed_mps == pytest.approx(0.2)
    with pytest.raises(ToolError, match="odometry was lost"):
        drift(odometry, 5.0, 6.0)
    with pytest.raises(ToolError, match="does not move"):
        require_motion(odometry)
