# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry through pauses, restarts and long drives, and odometry from wheel counts."""

import math
import struct

import pytest
from lossy_drives import (
    PERIOD_S,
    attached,
    line,
    lose,
    settled,
)
from lossy_odometry import DELTA, POSE, TEXT, Line, loses_nothing

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.omnibot import DeltaFrame, ImuFrame, OmniBot, OmniBotSettings, encode
from omnibot_driver.core.omnibot.translation import Translation
from omnibot_driver.core.readings import DisplacementReading, PoseReading
from omnibot_driver.simulator.omnibot import BoardSettings

# Pauses and restarts


def restart_unheard(on: Line, boots_s: float, runs_s: float) -> None:
    """Restart the board, start it ``boots_s`` later, and let it run for ``runs_s``.

    During all this, no frame from the board arrives.
    """
    on.loses = lambda _data, _now: True
    on.board.receive(b"R")
    on.run(boots_s)
    on.board.receive(bytes(3) + b"S")
    on.run(runs_s)
    on.loses = loses_nothing


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("seed", [0, 3, 5])
def test_a_pause_in_the_middle_of_motion_loses_nothing(seed: int, hidden: bool) -> None:
    """A pause during a drive loses no motion, even if all frames of the pause are lost.

    The robot rolls until it stops. One second after the pause, odom is right.
    """
    on = line(seed)
    if hidden:
        on.loses = lambda _data, _now: True
    on.board.receive(b"P")
    on.run(1.32)
    on.board.receive(b"P")
    on.run(0.2)
    on.loses = loses_nothing
    on.run(1.0)
    assert settled(on), on.error


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [(), (TEXT,), (TEXT, DELTA), (TEXT, POSE)])
@pytest.mark.parametrize("seed", [0, 3, 5])
def test_a_restarted_board_goes_on_where_odom_is(seed: int, hidden: tuple[bytes, ...]) -> None:
    """The board restarts, so SEQ and its pose begin at zero. Odom continues from its last pose.

    ``hidden``: the types of frames that are lost during the restart, by their first two bytes.
    """
    on = line(seed)
    on.drives = False
    on.run(1.0)
    before, true = on.estimates[-1].pose, on.board.truth
    on.loses = lambda data, _now: data[:2] in hidden
    on.board.receive(b"R")
    on.run(0.9 + seed / 10)
    on.board.receive(bytes(3) + b"S")
    on.run(0.1)
    on.drives, on.loses = True, loses_nothing
    on.run(2.0)
    was, now = Pose(true.x_m, true.y_m, true.yaw_rad), on.board.truth
    way = was.way_to(Pose(now.x_m, now.y_m, now.yaw_rad))
    odom_way = before.way_to(on.estimates[-1].pose)
    assert way.way_m > 0.1
    assert math.hypot(way.x_m - odom_way.x_m, way.y_m - odom_way.y_m) < 0.025  # motion of 40 ms
    assert way.yaw_rad == pytest.approx(odom_way.yaw_rad, abs=0.025)


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_restart_in_a_pause_moves_nothing_whatever_count_is_heard_first(frame: str) -> None:
    """A paused board restarts at rest. No frame arrives until the board has run for 4 s.

    The first delta then has a higher count than the last one before the pause. Odom stays where it
    was.
    """
    on = line(0, frame=frame)
    on.drives = False
    on.run(0.5)
    on.board.receive(b"P")
    on.run(1.1)
    before = on.estimates[-1].pose
    restart_unheard(on, 1.0, 4.0)
    on.run(1.0)
    way = before.way_to(on.estimates[-1].pose)
    assert way.way_m < 0.001
    assert abs(way.yaw_rad) < 0.001


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_restarted_board_that_first_moves_unheard_does_not_move_odom_to_its_origin(
    frame: str,
) -> None:
    """A board restarts in a drive, and the robot drives for 0.4 s before frames arrive.

    Odom continues from its last pose, and does not move to the board's new origin.
    """
    on = Line(BoardSettings(seed=1, frame=frame, running=True), seed=1)
    on.run(4.0)
    before = on.estimates[-1].pose
    assert before.way_m > 0.5
    restart_unheard(on, 0.9, 0.4)
    (first, *_) = on.run(0.3)
    assert before.way_to(first.pose).way_m < 0.02


def test_a_restart_leaves_its_doubt_in_the_covariance_for_good() -> None:
    """The board restarts while the robot drives, so it is unknown how far the robot rolled.

    The covariance stays larger from then on.
    """
    on = line(1)
    before = on.estimates[-1].covariance
    on.board.receive(b"R")
    on.run(1.0)
    on.board.receive(bytes(3) + b"S")
    after = on.run(2.0)[-1].covariance
    assert after.xx > before.xx + 0.003
    assert after.yaw_yaw > before.yaw_yaw + 0.01


def test_a_driver_that_restarts_begins_at_the_identity() -> None:
    """When the driver restarts, odom begins at zero, whatever the board's pose is."""
    on = line(1)
    on.translation, on.odometry = Translation(OmniBotSettings()), Odometry(OdometrySettings())
    on.attached = on.told
    first = on.run(0.44)[0].pose
    assert first.way_m < 0.03
    on.run(3.0)
    assert settled(on)


def test_a_reset_in_an_open_gap_is_not_moved_by_what_settles_the_gap() -> None:
    """Displacements are lost. The odometry is reset before a pose has shown the lost motion.

    The board's next pose contains the lost motion, but odom contains only the motion after the
    reset.
    """
    for seed in range(4):
        on = line(seed)
        lose(on, 1.0)
        on.run(PERIOD_S)
        on.odometry.reset()
        on.attached = on.told
        on.run(2.0)
        assert on.error.way_m < 0.01
        assert abs(on.error.yaw_rad) < 0.001


def test_a_line_that_is_opened_again_finds_the_robot_where_it_went() -> None:
    """No data arrives for three seconds while the robot drives. Then the line is opened again.

    Afterwards odom includes the motion of these seconds.
    """
    on = line(2)
    on.loses = lambda _data, _now: True
    on.run(3.0)
    on.translation.connect()
    on.loses = loses_nothing
    on.run(1.0)
    assert settled(on), on.error


# Rounding


@pytest.mark.slow
@pytest.mark.parametrize(("frame", "count"), [("earth", 22_500), ("body", 6_000)])
def test_a_quarter_of_an_hour_of_rounded_displacements_stays_within_2_mm_and_2_mrad(
    frame: str, count: int
) -> None:
    """In up to 15 minutes of slow driving, the rounding errors of the deltas do not add up.

    The board's pose after every fifth delta corrects odom.
    """
    odometry = attached()
    x = y = yaw = worst_m = worst_rad = 0.0
    for number in range(1, count + 1):
        t = number * PERIOD_S
        speed, turn = 0.012 * math.sin(0.11 * t) + 0.006, 0.02 * math.sin(0.037 * t) + 0.003
        dx, dy = speed * math.cos(yaw + turn / 2), speed * math.sin(yaw + turn / 2)
        told = (dx, dy) if frame == "earth" else (speed * (turn / 2) / math.sin(turn / 2), 0.0)
        x, y, yaw = x + dx, y + dy, yaw + turn
        rounded = (round(value * 1e4) / 1e4 for value in (*told, turn))
        (estimate,) = odometry.displace(DisplacementReading(*rounded, frame, PERIOD_S, 0), t)
        if number % 5 == 0:
            odometry.settle(PoseReading(*(float32(value * 1000) / 1000 for value in (x, y, yaw))))
        worst_m = max(worst_m, math.hypot(estimate.pose.x_m - x, estimate.pose.y_m - y))
        worst_rad = max(worst_rad, abs(estimate.pose.yaw_rad - yaw))
    assert worst_m < 0.002
    assert worst_rad < 0.002


def float32(value: float) -> float:
    (rounded,) = struct.unpack(">f", struct.pack(">f", value))
    assert isinstance(rounded, float)
    return rounded


# Wheel counts


def test_wheel_counts_go_through_the_kinematics() -> None:
    """Deltas in wheel counts are converted to the motion of the robot.

    * All wheels backward by 1/8 of a turn: the robot turns left in place.
    * Wheel B forward, wheel A backward: the robot drives straight ahead.
    """
    bot = OmniBot(OmniBotSettings(delta_frame="wheel_counts"))
    bot.receive(encode(ImuFrame((0, 0, -16384), (0, 0, 0))) * 2, 0.0)
    odometry = Odometry(OdometrySettings())
    frames = [DeltaFrame(-195, -195, -195, 254), DeltaFrame(-100, 100, 0, 255)]
    rim = math.tau * 0.029 / 1560
    expected = [
        Pose(0.0, 0.0, 195 * rim / 0.143),
        Pose(0.0, 0.0, 195 * rim / 0.143).moved(Pose(200 * rim / math.sqrt(3), 0.0, 0.0)),
    ]
    for frame, pose in zip(frames, expected, strict=True):
        found = bot.receive(encode(frame), 0.0) + bot.flush(0.0)
        (reading,) = found
        assert isinstance(reading, DisplacementReading)
        (estimate,) = odometry.displace(reading, 0.0)
        assert estimate.pose.way_to(pose).way_m < 1e-12
        assert estimate.pose.yaw_rad == pytest.approx(pose.yaw_rad)
