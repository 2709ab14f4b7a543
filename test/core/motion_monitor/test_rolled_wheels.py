# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Wheel angles computed from displacements, over losses, restarts and resets."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lossy_odometry import Line
from strategies import axis_signs, small_moves

from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.omnibot import DeltaFrame, OmniBotSettings
from omnibot_driver.core.omnibot.translation import Translation
from omnibot_driver.core.readings import DisplacementReading, PoseReading
from omnibot_driver.simulator.omnibot import BoardSettings

PERIOD_S = 0.04
WHEELS = OmniKinematics(wheel_radius_m=0.029, base_radius_m=0.143)
RAD_PER_COUNT = math.tau / 1560
Signs = tuple[int, int, int]


def angles(rolled: Pose) -> tuple[float, float, float]:
    return WHEELS.wheel_rates(BodyTwist(rolled.x_m, rolled.y_m, rolled.yaw_rad))


def angles_by_encoder(line: Line) -> tuple[float, ...]:
    return tuple(count * RAD_PER_COUNT for count in line.board._world.encoders)


@pytest.mark.slow
@settings(max_examples=40)
@given(axis_signs, st.lists(small_moves, min_size=1, max_size=20), st.sampled_from("eb"))
def test_wheels_from_the_bodys_displacements_and_back(
    signs: Signs, tangents: list[Pose], frame: str
) -> None:
    """``rolled`` sums all displacements in the robot's axes, whichever axes the board uses.

    A conversion of ``rolled`` to wheel angles and back keeps the yaw angle.
    """
    odometry, board = Odometry(OdometrySettings(), signs), Pose(3.0, -2.0, 1.0)
    for _ in range(2):
        odometry.settle(PoseReading(board.x_m, board.y_m, board.yaw_rad))
    estimates: list[OdometryEstimate] = []
    for number, tangent in enumerate(tangents):
        before, board = board, board.moved(roll(tangent))
        if frame == "e":
            step = board - before
            reading = DisplacementReading(step.x_m, step.y_m, step.yaw_rad, "earth", PERIOD_S, 0)
        else:
            reading = DisplacementReading(
                tangent.x_m, tangent.y_m, tangent.yaw_rad, "body", PERIOD_S, 0
            )
        estimates += odometry.displace(reading, number * PERIOD_S)
    rolled, last = estimates[-1].rolled, estimates[-1].rolling
    wanted = sum(tangents, Pose())
    assert (rolled.x_m, rolled.y_m, rolled.yaw_rad) == pytest.approx(
        (wanted.x_m, wanted.y_m, wanted.yaw_rad), abs=1e-9
    )
    assert last is not None
    assert last.vx_mps * PERIOD_S == pytest.approx(tangents[-1].x_m, abs=1e-9)
    back = WHEELS.body_twist(angles(rolled))
    assert back.yaw_rate_radps == pytest.approx(rolled.yaw_rad, abs=1e-9)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.lists(st.tuples(*[st.integers(-300, 300)] * 3), min_size=1, max_size=20))
def test_wheel_counts_are_the_wheels_angles_exactly(counts: list[tuple[int, int, int]]) -> None:
    """Wheel counts are converted to motions of the body and back to wheel angles.

    Nothing is lost.
    """
    translation = Translation(OmniBotSettings(delta_frame="wheel_counts"))
    odometry = Odometry(OdometrySettings())
    estimates: list[OdometryEstimate] = []
    for number, words in enumerate(counts):
        frame = DeltaFrame(*words, number % 256)
        (reading,) = translation.readings([frame], [0], number * PERIOD_S)
        assert isinstance(reading, DisplacementReading)
        estimates += odometry.displace(reading, number * PERIOD_S)
    turned = [sum(column) * RAD_PER_COUNT for column in zip(*counts, strict=True)]
    assert angles(estimates[-1].rolled) == pytest.approx(turned, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lost_s", "off_rad"), [(0.0, 0.12), (0.04, 0.12), (0.4, 0.12), (2.0, 5.0)]
)
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_over_a_gap_the_angles_are_those_of_the_encoders(
    lost_s: float, off_rad: float, frame: str
) -> None:
    """After a gap of up to 0.4 s, the wheel angles agree with the encoders within 0.12 rad.

    After a gap of 2 s, the error is up to 5 rad, because the driver assumes the shortest path.
    """
    for seed in range(3):
        line = Line(BoardSettings(seed=seed, frame=frame, running=True), seed=seed)
        line.run(2.0)
        line.loses = lambda _data, _now: True
        line.run(lost_s)
        line.loses = lambda _data, _now: False
        line.run(1.0)
        got = angles(line.estimates[-1].rolled)
        assert got == pytest.approx(angles_by_encoder(line), abs=off_rad)


def test_the_angles_go_on_over_a_reset_of_the_odometry_and_a_restart_of_the_board() -> None:
    """The odometry is reset, and later the board restarts. The wheel angles continue."""
    line = Line(BoardSettings(running=True))
    line.run(3.0)
    before = angles(line.estimates[-1].rolled)
    line.odometry.reset()
    line.run(PERIOD_S)
    after = angles(line.estimates[-1].rolled)
    assert max(map(abs, before)) > 1.0
    assert after == pytest.approx(before, abs=1.0)
    line.board.reboot()
    line.drives = False
    line.run(1.0)
    line.board.receive(bytes(3) + b"S")
    line.run(2.0)
    assert angles(line.estimates[-1].rolled) == pytest.approx(angles_by_encoder(line), abs=1.5)


def test_what_took_an_unknown_time_has_no_rate() -> None:
    """A displacement has an unknown duration, as after a pause. Wheel rates are then unknown.

    The distance that the wheels have rolled is known.
    """
    odometry = Odometry(OdometrySettings())
    (estimate,) = odometry.displace(DisplacementReading(0.1, 0.0, 0.0, "body", None, 0), 1.0)
    assert estimate.rolling is None
    assert estimate.rolled == Pose(0.1, 0.0, 0.0)
