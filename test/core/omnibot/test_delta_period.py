# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of boards that send deltas at a rate other than 25 Hz, with a driver set to that rate."""

import math
from itertools import pairwise

import pytest
from lossy_odometry import DELTA, Line
from robots import reconnect
from session_bench import Bench
from streams import BYTE_S, TICK_S, frames_of

from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.omnibot import FrameDecoder
from omnibot_driver.core.omnibot.cost_model import Context, Expectation
from omnibot_driver.core.omnibot.frame_schedule import FrameSchedule
from omnibot_driver.core.omnibot.frames import DeltaFrame, ImuFrame, PoseFrame
from omnibot_driver.core.omnibot.modes import ModeTracker
from omnibot_driver.core.omnibot.schedule import DELTA_PERIODS_S, Schedule
from omnibot_driver.core.omnibot.sequence import Sequence
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

TEN_HZ_S = 0.1
EVERY_PERIOD = pytest.mark.parametrize("period_s", DELTA_PERIODS_S)


def driving(period_s: float, *, seconds: float = 3.0, **settings: object) -> Bench:
    """Return a bench whose robot has been driving in circles for ``seconds``."""
    bench = Bench(BoardSettings(running=True, delta_period_s=period_s, **settings))  # type: ignore[arg-type]
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.0)
    drive(bench, seconds)
    return bench


def drive(bench: Bench, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        bench.drive(0.3, -0.1, 0.4)
        bench.run(0.1)


def off_by_m(bench: Bench) -> float:
    pose, truth = bench.odometry[-1].pose, bench.board.truth
    return math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("period_s", "frame"),
    [
        *((period_s, "earth") for period_s in DELTA_PERIODS_S),
        *(
            (period_s, frame)
            for period_s in (min(DELTA_PERIODS_S), max(DELTA_PERIODS_S))
            for frame in ("body", "wheel_counts")
        ),
    ],
)
def test_twist_pose_and_stamps_are_right_at_any_rate(period_s: float, frame: str) -> None:
    """The robot drives at 0.3 m/s, -0.1 m/s and 0.4 rad/s. The driver publishes the right values.

    No frame is counted as lost.
    """
    bench = driving(period_s, frame=frame)
    begun, readings = len(bench.odometry), sum(isinstance(e, ImuEstimate) for e in bench.events)
    drive(bench, 3.0)
    estimates = bench.odometry[begun:]
    assert len(estimates) == round(3.0 / period_s)
    assert sum(isinstance(e, ImuEstimate) for e in bench.events) - readings == 300
    twists = [estimate.twist for estimate in estimates if estimate.twist is not None]
    assert len(twists) == len(estimates)
    for part, speed in (("vx_mps", 0.3), ("vy_mps", -0.1), ("yaw_rate_radps", 0.4)):
        mean = sum(getattr(twist, part) for twist in twists) / len(twists)
        assert mean == pytest.approx(speed, abs=0.01)
    assert off_by_m(bench) < 0.005
    for before, after in pairwise(estimates):
        assert after.stamp_s - before.stamp_s == pytest.approx(period_s, abs=1e-6)
    figures = bench.session.figures(bench.now)
    assert figures.board.rates_hz == {
        "IMU": 100.0,
        "Odometry": pytest.approx(1 / period_s),
        "Pose": 5.0,
    }
    assert (figures.board.faults, figures.tally.lost_imu, figures.tally.gaps) == (0, 0, 0)
    assert bench.notices == []


@pytest.mark.slow
@EVERY_PERIOD
def test_an_undamaged_stream_is_decoded_whole_in_ticks_and_byte_by_byte(period_s: float) -> None:
    """At every delta period, all frames of an undamaged stream are returned, without a fault."""
    board = SimulatedBoard(BoardSettings(running=True, delta_period_s=period_s))
    ticks = [board.step() for _ in range(600)]
    stream = b"".join(ticks)
    expected = [frame for _, frame in frames_of(stream)]
    in_ticks = [(data, number * TICK_S) for number, data in enumerate(ticks)]
    in_bytes = [
        (data[place : place + 1], at_s + place * BYTE_S)
        for data, at_s in in_ticks
        for place in range(len(data))
    ]
    for pieces in (in_ticks, in_bytes, [(stream, 0.0)]):
        decoder, found = FrameDecoder(schedule=Schedule(period_s)), []
        for data, at_s in pieces:
            found += decoder.feed(data, at_s)
        assert found + decoder.flush(100.0) == expected
        assert decoder.statistics.faults == 0


def test_ten_imu_frames_to_a_delta_and_two_deltas_to_a_pose_are_on_the_beat_at_10_hz() -> None:
    """At the set rate of deltas, only the usual order of frames has no cost.

    At 10 Hz, ten IMU frames come before a delta, and two deltas before a pose. At 25 Hz, four IMU
    frames come before a delta, and five deltas before a pose.
    """
    delta, pose = DeltaFrame(0, 0, 0, 8), PoseFrame(0.0, 0.0, 0.0, 5)
    last = PoseFrame(0.0, 0.0, 0.0, 4)
    for schedule, right in ((Schedule(0.1), True), (Schedule(), False)):
        expectation = Expectation(16384.0, schedule)
        for imus, deltas, on_beat in ((10, 2, right), (4, 5, not right)):
            before = Context(seq=7, pose=last, imus=imus, deltas=deltas, turned=0)
            assert (expectation.weigh(delta, before)[0] == 0.0) is on_beat
            after = before._replace(imus=0)
            assert (expectation.weigh(pose, after)[0] == 0.0) is on_beat


@EVERY_PERIOD
def test_a_delta_is_possible_up_to_10_m_per_s(period_s: float) -> None:
    """At any delta period, a delta at 9.9 m/s is possible, and a delta at 10.1 m/s is not."""
    expectation = Expectation(16384.0, Schedule(period_s))
    for speed_mps, possible in ((9.9, True), (10.1, False)):
        delta = DeltaFrame(round(speed_mps * period_s * 1e4), 0, 0, 8)
        assert (expectation.weigh(delta, Context())[0] == 0.0) is possible


@EVERY_PERIOD
def test_deltas_that_are_all_rounded_alike_do_not_contradict_the_pose(period_s: float) -> None:
    """A pose may differ from the deltas by the sum of their rounding errors without a cost.

    A difference of more than twice this sum has a cost.
    """
    schedule = Schedule(period_s)
    expectation, deltas = Expectation(16384.0, schedule), schedule.deltas_per_pose
    before = Context(seq=7, pose=PoseFrame(0.0, 0.0, 0.0, 4), deltas=deltas, turned=0)
    for off_mrad, contradicts in ((0.05 * deltas, False), (0.1 * deltas + 0.2, True)):
        cost, _ = expectation.weigh(PoseFrame(0.0, 0.0, off_mrad, 5), before)
        assert (cost > 0.0) is contradicts


@pytest.mark.slow
@pytest.mark.parametrize("lost", [1, 2, 3, 9, 10, 11, 30, 100, 300])
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_second_after_any_gap_odom_is_the_boards_own_pose_again(lost: int, frame: str) -> None:
    """Deltas come at 10 Hz, and up to 300 are lost. SEQ wraps in the longest gap.

    1.2 s after the gap, odom is right within 3 mm and 3 mrad.
    """
    for seed in range(3 if lost < 30 else 1):
        on = Line(
            BoardSettings(running=True, delta_period_s=TEN_HZ_S, frame=frame, seed=seed), seed=seed
        )
        on.run(3.0)
        on.loses = lambda _data, _now: True
        on.run(lost * TEN_HZ_S)
        on.loses = lambda _data, _now: False
        on.run(1.2)
        assert on.error.way_m < 0.003
        assert abs(on.error.yaw_rad) < 0.003


def test_a_lost_delta_is_bridged_and_settled() -> None:
    """Deltas come at 10 Hz, with a pose after every second delta. Some deltas are lost.

    The next pose shows the motion of the lost deltas, so odom is right again.
    """
    on = Line(BoardSettings(running=True, delta_period_s=TEN_HZ_S))
    on.run(3.0)
    on.loses = lambda data, _now: data[:2] == DELTA
    on.run(0.3)
    on.loses = lambda _data, _now: False
    on.run(0.6)
    assert on.error.way_m < 0.003


@EVERY_PERIOD
def test_sequence_counts_what_is_lost_in_this_period(period_s: float) -> None:
    """At any delta period, the driver counts correctly how many deltas are lost in a gap.

    In a long gap, the deltas' counter SEQ wraps several times.
    """
    schedule = Schedule(period_s)
    for lost in (0, 1, 7, 200, 256, 300, 1000):
        sequence = Sequence(schedule)
        for count in range(20):
            sequence.delta(count, count * period_s, imus=schedule.imus_per_delta)
        step = sequence.delta((20 + lost) % 256, (20 + lost) * period_s)
        assert (step.lost, step.duration_s, step.restarted) == (lost, period_s, False)


@pytest.mark.parametrize("period_s", [period_s for period_s in DELTA_PERIODS_S if period_s >= 0.04])
def test_a_restart_shows_in_the_count(period_s: float) -> None:
    """A delta has the count 1 after a gap of 1.5 s. Without a restart, this count is impossible.

    So the board has restarted.
    """
    sequence = Sequence(Schedule(period_s))
    for count in range(100):
        sequence.delta(count, count * period_s)
    assert sequence.delta(1, 99 * period_s + 1.5).restarted


@pytest.mark.slow
@pytest.mark.parametrize("action", [Request.RESET, "pause", "unplugged"])
def test_odom_goes_on_over_what_happens_to_a_board_at_10_hz(action: object) -> None:
    """A board with deltas at 10 Hz is reset, or paused and started, or connected again.

    The odometry continues.
    """
    bench = driving(TEN_HZ_S)
    bench.run(2.0)
    begun = off_by_m(bench)
    if action is Request.RESET:
        assert bench.ask(Request.RESET, 9.0).success
    elif action == "pause":
        assert bench.ask(Request.PAUSE, 4.0).success
        bench.run(2.0)
        assert bench.ask(Request.START, 4.0).success
    else:
        reconnect(bench)
    bench.run_until_state("nominal")
    bench.run(2.0)
    drive(bench, 3.0)
    bench.run(1.0)
    assert off_by_m(bench) < begun + 0.01


@pytest.mark.slow
@EVERY_PERIOD
def test_imu_only_mode_needs_six_missing_deltas(period_s: float) -> None:
    """At any delta period, the driver assumes IMU-only mode only when six deltas are missing."""
    schedule = Schedule(period_s)
    assert schedule.imus_alone > max(24, 6 * schedule.imus_per_delta)
    assert ModeTracker(schedule).imus_to_come == schedule.imus_alone
    bench = driving(period_s)
    states = []
    for _ in range(50):
        data = bench.board.step()
        bench.now += 0.01
        if len(data) == 14:  # deltas are lost
            bench.session.inbound.receive(data, bench.now)
        bench.settle()
        states.append(bench.session.state)
    assert set(states[: min(50, schedule.imus_alone - schedule.imus_per_delta)]) == {"nominal"}


@EVERY_PERIOD
@pytest.mark.parametrize("running", [True, False])
@pytest.mark.slow
def test_a_board_in_imu_only_mode_is_recognized(period_s: float, running: bool) -> None:
    """The driver recognizes IMU-only mode, also if the board is paused at first."""
    bench = Bench(BoardSettings(imu_only=True, running=running, delta_period_s=period_s))
    bench.open()
    bench.run_until_state("imu_only", 4.0)


@EVERY_PERIOD
def test_bytes_that_made_no_frame_tell_how_many_imu_frames_they_were(period_s: float) -> None:
    """At any delta period, the number of discarded bytes shows how many IMU frames were lost.

    Here, the bytes of an IMU frame (14) and a delta (9) are discarded.
    """
    schedule = Schedule(period_s)
    rhythm = FrameSchedule(schedule)
    for _ in range(3):
        for _ in range(schedule.deltas_per_pose):
            for kind in (*[ImuFrame] * schedule.imus_per_delta, DeltaFrame):
                assert rhythm.hear(kind, 0) == 0
        assert rhythm.hear(PoseFrame, 0) == 0
    for _ in range(schedule.imus_per_delta - 1):
        assert rhythm.hear(ImuFrame, 0) == 0
    assert rhythm.hear(ImuFrame, 14 + 9) == 1
