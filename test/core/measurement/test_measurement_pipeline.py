# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of measurements from a complete session: SI units, stamps and a continuous pose."""

import itertools
import math

import pytest
from robots import push, standing
from session_bench import Bench, bare

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings


@pytest.fixture
def bench() -> Bench:
    return standing()


def test_imu_estimates_come_every_tick_and_in_si_units(bench: Bench) -> None:
    """An IMU reading is published for each tick. The sensor is upside down, so z is −9.8 m/s²."""
    start = bench.now
    bench.run(1.0)
    imu = [
        event for event in bench.events if isinstance(event, ImuEstimate) and event.stamp_s > start
    ]
    assert 98 <= len(imu) <= 101
    mean = sum(estimate.specific_force[2] for estimate in imu) / len(imu)
    assert mean == pytest.approx(-9.8, abs=0.1)


def test_odometry_has_the_stamps_of_its_own_ticks_samples(bench: Bench) -> None:
    """Each odometry estimate has the stamp of the IMU sample of the same tick.

    This also holds for the first estimates, which wait for the board's first pose.
    """
    stamps = {event.stamp_s for event in bench.events if isinstance(event, ImuEstimate)}
    assert len(bench.odometry) > 30
    assert {estimate.stamp_s for estimate in bench.odometry} <= stamps


def test_stamps_go_forward_over_a_restart_and_a_reconnect(bench: Bench) -> None:
    """The board restarts, and later the port is opened again. The stamps increase all the time.

    In the end, they are 10 ms apart again.
    """
    bench.board.reboot()
    bench.run_until_state("paused")
    bench.run_until_state("nominal")
    bench.run(1.0)
    bench.close()
    bench.run(0.5)
    bench.open()
    bench.run(1.0)
    stamps = [event.stamp_s for event in bench.events if isinstance(event, ImuEstimate)]
    assert all(before < after for before, after in itertools.pairwise(stamps))
    assert stamps[-1] <= bench.now
    ends = zip(stamps[-50:], stamps[-49:], strict=False)
    assert all(after - before == pytest.approx(0.01, abs=1e-6) for before, after in ends)


def test_reset_odometry_zeroes_the_pose_and_the_way_goes_on_from_there(bench: Bench) -> None:
    """After a reset during a drive, odom shows the distance since the reset, or up to 20 mm more.

    The first displacement after the reset may contain motion from before it.
    """
    for _ in range(10):
        bench.drive(0.5)
        bench.run(0.1)
    way_before = bench.board.truth.x_m
    bench.session.reset_odometry(bench.now)
    for _ in range(10):
        bench.drive(0.5)
        bench.run(0.1)
    bench.run(1.0)
    way = bench.board.truth.x_m - way_before
    unreported = 0.04 * 0.5
    assert 0.0 <= bench.odometry[-1].pose.x_m - way <= unreported


def test_the_odometry_is_not_reset_while_the_board_is_silent_or_the_port_is_closed(
    bench: Bench,
) -> None:
    """A reset of the odometry is refused while no data arrives or the port is closed.

    Otherwise, later data could add motion from before the reset.
    """
    bench.speaks = False
    bench.run(2.0)
    with pytest.raises(RequestRefused, match="no valid data"):
        bench.session.reset_odometry(bench.now)
    bench.close()
    push(bench, 1.0, 0.0, 0.0)
    with pytest.raises(RequestRefused, match="port is not open"):
        bench.session.reset_odometry(bench.now)
    bench.open()
    bench.run(0.1)
    with pytest.raises(RequestRefused, match="no valid data"):
        bench.session.reset_odometry(bench.now)
    bench.speaks = True
    bench.run_until_state("nominal")
    bench.session.reset_odometry(bench.now)
    bench.run(1.0)
    assert bench.odometry[-1].pose.way_m < 0.002


def test_a_reset_of_the_odometry_during_a_pause_forgets_the_motion_in_the_pause(
    bench: Bench,
) -> None:
    """After a reset in a pause, odom begins at zero, although the robot was pushed in the pause.

    The board's first displacement after the pause contains the push.
    """
    assert bench.ask(Request.PAUSE, 5.0).success
    push(bench, 1.0, 0.0, 0.3)
    bench.run(1.2)
    bench.session.reset_odometry(bench.now)
    bench.events.clear()
    assert bench.ask(Request.START, 5.0).success
    bench.run(1.0)
    assert len(bench.odometry) > 20
    assert max(estimate.pose.way_m for estimate in bench.odometry) < 0.002
    assert max(abs(estimate.pose.yaw_rad) for estimate in bench.odometry) < 0.002
    push(bench, 0.02, 0.0, 0.0)
    bench.run(0.5)
    pose = bench.odometry[-1].pose
    assert (pose.x_m, pose.y_m) == pytest.approx((0.02, 0.0), abs=0.002)


@pytest.mark.slow
def test_lost_odometry_frames_are_told_once_in_a_while_and_counted(bench: Bench) -> None:
    """Frames are lost thirty times. The driver combines the losses in only one or two notices."""
    for _ in range(30):
        bench.speaks = False
        bench.run(0.08)
        bench.speaks = True
        bench.run(0.4)
    losses = [text for text in bench.notices if "lost" in text]
    assert 1 <= len(losses) <= 2
    assert "lost on the line" in losses[0]


def test_frames_that_the_port_lost_are_not_blamed_on_the_line(bench: Bench) -> None:
    """The port overruns, and frames are lost. The notice blames this computer, not the line."""
    bench.run(0.4)
    bench.session.overran(1)
    bench.speaks = False
    bench.run(0.08)
    bench.speaks = True
    bench.run(0.4)
    (loss,) = [text for text in bench.notices if "lost" in text]
    assert "in this computer" in loss


def test_motion_during_a_pause_moves_the_pose_and_gives_no_speed(bench: Bench) -> None:
    """After a pause, odom includes the motion in the pause.

    The first twist is unknown, because the motion has an unknown duration.
    """
    bench.drive(0.5)
    bench.run(0.4)
    bench.ask(Request.PAUSE, 5.0)
    count = len(bench.odometry)
    bench.run(1.0)
    bench.ask(Request.START, 5.0)
    bench.run(1.0)
    after = bench.odometry[count:]
    assert after[0].twist is None
    assert all(abs(item.twist.vx_mps) < 0.01 for item in after[1:] if item.twist)
    assert after[-1].pose.x_m == pytest.approx(bench.board.truth.x_m, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("signs", list(itertools.product([1, -1], repeat=3)))
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_with_any_axis_signs_the_odometry_shows_what_was_commanded(
    signs: tuple[int, int, int], frame: str
) -> None:
    """Odom shows a commanded curve to the left, whatever the signs of the board's axes are.

    This also holds when the board starts with a heading of 2 rad.
    """
    bench = Bench(
        BoardSettings(frame=frame, initial_pose=BoardPose(0.0, 0.0, 2000.0), running=True),
        axis_signs=signs,
    )
    bench.open()
    bench.run(1.0)
    for _ in range(20):
        bench.drive(0.3, 0.1, 0.5)
        bench.run(0.1)
    pose, twist = bench.odometry[-1].pose, bench.odometry[-1].twist
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((0.37, 0.43, 0.95), abs=0.06)
    assert (twist.vx_mps, twist.vy_mps) == pytest.approx((0.3, 0.1), abs=0.03)
    assert bare(bench.written[-1][1])[3] == (0 if signs[0] > 0 else 0xFF)


def test_a_robot_that_drove_on_unheard_is_where_it_is_once_it_is_heard_again() -> None:
    """The cable is unplugged for 3 s while the robot drives on.

    When the cable is back, odom has the robot's true pose, within 5 mm and 5 mrad.
    """
    bench = Bench(BoardSettings(initial_pose=BoardPose(4000.0, 0.0, 1571.0), running=True))
    bench.open()
    bench.run(1.0)
    bench.drive(0.3, 0.0, 0.4)
    bench.run(0.3)
    bench.speaks = bench.hears = False
    bench.close()
    bench.run(3.0)
    bench.speaks = bench.hears = True
    bench.open()
    bench.run(2.0)
    truth, pose = bench.board.truth, bench.odometry[-1].pose
    assert math.hypot(truth.x_m, truth.y_m) > 0.7
    assert math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m) < 0.005
    assert pose.yaw_rad == pytest.approx(truth.yaw_rad, abs=0.005)
