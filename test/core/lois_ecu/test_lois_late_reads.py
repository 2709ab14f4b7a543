# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of reads that are late by seconds, so that many reports arrive at once."""

import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from statistics import fmean
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lois_bench import Bench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu.late_reads import LateReads
from omnibot_driver.core.lois_ecu.messages import GpsTime, Report, Ticks
from omnibot_driver.core.lois_ecu.plausibility import ClockUnit

KERNEL_BUFFER = 4096
"""Size of a pseudo-terminal's buffer, in bytes."""
PERIOD_MS = 200
FORWARD = BodyTwist(0.3, 0.0, 0.0)


def ticks(*clocks_ms: int) -> list[Report]:
    return [Ticks(clock_ms, 0, 0) for clock_ms in clocks_ms]


def listening(unit: ClockUnit = "ms") -> LateReads:
    """Return a ``LateReads`` that has received five tick reports on time, at 1.0 to 1.8 s."""
    late_reads = LateReads()
    for clock_ms in range(1000, 2000, PERIOD_MS):
        at_s = clock_ms / 1e3
        assert late_reads.times(ticks(clock_ms), [at_s], unit) == [at_s]
    return late_reads


def about(*times_s: float) -> Any:
    return pytest.approx(times_s, abs=0.04)


def read(late_reads: LateReads, now: float, *reports: Report) -> tuple[float, ...]:
    return tuple(late_reads.times(list(reports), [now] * len(reports), None))


def test_the_reports_of_a_late_read_have_the_times_that_the_boards_clock_shows() -> None:
    """Four reports come in one read. Their times are 0.2 s apart, as the board's clock shows."""
    found = read(listening(), 2.6, *ticks(2000, 2200, 2400, 2600))
    assert found == about(2.0, 2.2, 2.4, 2.6)


def test_the_reports_of_a_full_buffer_came_at_the_beginning_of_the_delay() -> None:
    """A read that is 5 s late contains the reports of only 1 s: the kernel's buffer was then full.

    These reports get times in the first second of the delay, not in the last.
    """
    late_reads = listening()
    found = read(late_reads, 6.8, *ticks(2000, 2200, 2400, 2600, 2800))
    assert found == about(2.0, 2.2, 2.4, 2.6, 2.8)
    assert read(late_reads, 6.9, *ticks(6900)) == about(6.9)


def test_a_backlog_may_come_in_several_reads() -> None:
    """The kernel returns 4 KiB at most, so the reports of a long stall come in several reads."""
    late_reads = listening()
    found = (
        *read(late_reads, 5.0, *ticks(2000, 2200, 2400, 2600)),
        *read(late_reads, 5.001, *ticks(2800)),
        *read(late_reads, 5.002, *ticks(3000, 3200, 3400, 3600, 3800)),
        *read(late_reads, 5.003, *ticks(4000, 4200, 4400, 4600, 4800, 5000)),
    )
    assert found == about(*(clock_ms / 1e3 for clock_ms in range(2000, 5001, PERIOD_MS)))


def test_a_report_between_ticks_has_the_time_of_the_ticks_before_it() -> None:
    """A GPS report has no clock. It gets the time of the tick report directly before it."""
    found = read(listening(), 2.4, *ticks(2000), GpsTime(1, 2, 3), *ticks(2200, 2400))
    assert found == about(2.0, 2.0, 2.2, 2.4)


def test_a_report_whose_ticks_were_discarded_came_between_the_ticks() -> None:
    """A GPS report after a discarded tick report gets a time between the tick reports around it."""
    found = read(listening(), 2.6, GpsTime(1, 2, 3), *ticks(2200, 2400, 2600))
    assert found == about(2.0, 2.2, 2.4, 2.6)


def test_if_every_read_is_late_the_times_do_not_drift() -> None:
    """Every read is late, and the board's clock is slow by 0.5 % for 20 min.

    The estimated times do not fall behind: the last report of each read gets the time of this read.
    """
    late_reads = listening()
    for number in range(2000):
        clock_ms = 1999 + 597 * number
        now = 2.0 + 0.6 * (number + 1)
        found = read(late_reads, now, *ticks(clock_ms, clock_ms + 199, clock_ms + 398))
    assert found[-1] == pytest.approx(now, abs=0.05)


def test_after_a_restart_the_clock_shows_the_time_since_then() -> None:
    """The board restarts, and its clock begins at zero.

    The estimated time of a report after the restart is the sum of the last time before the restart
    and the clock value in this report.
    """
    found = read(listening(), 4.0, *ticks(2000, 100, 300, 500))
    assert found == about(2.0, 2.1, 2.3, 2.5)


def test_the_clock_after_a_restart_is_not_slowed_by_sending() -> None:
    """While the public firmware sends, its clock does not run: 200 ms of the clock take 218 ms.

    While the board boots, it sends nothing, so its clock runs at the right rate.
    """
    late_reads = LateReads()
    for number in range(5):
        late_reads.times(ticks(1000 + 200 * number), [1.0 + 0.218 * number], "ms")
    last_s = 1.0 + 0.218 * 4
    found = read(late_reads, last_s + 3.0, *ticks(2000, 2000, 2200))
    assert found[1] == pytest.approx(found[0] + 2.0)


def test_a_clock_in_ns_near_zero_shows_nothing() -> None:
    """If a clock in ns is near zero, the reports get the time of the read.

    The driver cannot tell whether the board has restarted or the clock has wrapped.
    """
    late_reads = listening("ns")
    found = read(late_reads, 4.0, Ticks(2000, 50, 50), Ticks(100, 3, 3), Ticks(300, 4, 4))
    assert found == (4.0, 4.0, 4.0)


@given(
    st.lists(
        st.tuples(st.integers(-300, 500), st.floats(0.0, 3.0), st.booleans()),
        min_size=1,
        max_size=40,
    ),
    st.sampled_from(["ms", "ns"]),
)
def test_times_never_decrease_and_are_not_after_the_arrival(
    told: list[tuple[int, float, bool]], unit: ClockUnit
) -> None:
    """Report times never decrease, and are never after the read, for any values of the clock."""
    late_reads, clock_ms, now, last_s = listening(unit), 1800, 1.8, 1.8
    reports: list[Report] = []
    for passed_ms, pause_s, is_read in [*told, (200, 0.1, True)]:
        clock_ms = max(0, clock_ms + passed_ms)
        reports += [GpsTime(1, 2, 3), *ticks(clock_ms)]
        if is_read:
            now += pause_s
            found = read(late_reads, now, *reports)
            assert all(before <= after for before, after in pairwise([last_s, *found]))
            last_s, reports = found[-1], []
            assert last_s <= now


def stalled_drive(
    bench: Bench,
    stall_s: float,
    twist: BodyTwist = FORWARD,
    most: int = KERNEL_BUFFER,
    during: Callable[[float], None] = lambda _: None,
) -> tuple[float, float]:
    """Drive, read nothing for ``stall_s``, and stand still for 3 s.

    Return the error and the standard deviation of the estimated position, in m.

    * ``most``: number of bytes that the kernel keeps.
    * ``during``: function that is called with the time since the beginning of the stall, in s.
    """
    origin, begin = bench.odometry[-1].pose, true_pose(bench)
    for _ in range(25):
        bench.session.command_twist(twist, bench.now)
        bench.settle()
        bench.run(0.1)
    held = b""
    for tick in range(round(stall_s / 0.01)):
        during(tick * 0.01)
        bench.now += 0.01
        held += b"".join(data for _, data in bench.robot.advance())
    bench.session.stood_still(stall_s, bench.now)
    seen = len(bench.odometry)
    for place in range(0, min(len(held), most), KERNEL_BUFFER):
        piece = held[place : min(place + KERNEL_BUFFER, most)]
        bench.session.inbound.receive(piece, bench.now)
        bench.now += 0.001
    bench.settle()
    bench.run(3.0)
    for estimate in bench.odometry[seen:]:
        assert estimate.twist is not None
        assert estimate.twist_variances is not None
        stddev_mps = math.sqrt(estimate.twist_variances[0])
        assert abs(estimate.twist.vx_mps) < 0.5 + 3 * stddev_mps, "the robot never drove so fast"
    last = bench.odometry[-1]
    off = origin.way_to(last.pose) - begin.way_to(true_pose(bench))
    return off.way_m, math.sqrt(last.covariance.xx + last.covariance.yy)


def stalled_drives(
    firmware: str,
    stall_s: float,
    twist: BodyTwist = FORWARD,
    during: Callable[[Bench, float], None] = lambda _bench, _s: None,
) -> list[tuple[float, float]]:
    """Return the results of ``stalled_drive`` in eight phases of the board's timers.

    The phases are spread over 0.2 s, the longest period of these timers.
    """
    results = []
    for phase in range(8):
        bench = Bench(firmware)
        bench.run(0.02 + phase * 0.03)
        results.append(stalled_drive(bench, stall_s, twist, during=partial(during, bench)))
    return results


def assert_described(results: list[tuple[float, float]]) -> None:
    """Assert that each error, and the mean square of all errors, fits the standard deviations."""
    for error_m, stddev_m in results:
        assert error_m < max(0.06, 3.5 * stddev_m)
    assert fmean((error_m / stddev_m) ** 2 for error_m, stddev_m in results) < 4.0


def true_pose(bench: Bench) -> Pose:
    truth = bench.board.truth
    return Pose(truth.x_m, truth.y_m, truth.yaw_rad)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "stall_s"), [("documented", 0.75), ("documented", 3.0), ("firmware", 1.5)]
)
def test_after_a_stall_twist_and_pose_are_those_of_the_robot(firmware: str, stall_s: float) -> None:
    """The driver stalls during a drive. Then the pose is right, and the twist is plausible."""
    bench = Bench(firmware)
    error_m, _ = stalled_drive(bench, stall_s)
    assert error_m < 0.06
    assert not any("does not move" in text for text in bench.notices)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "twist", "stall_s"),
    [
        ("documented", BodyTwist(-0.3, 0.0, 0.0), 3.0),
        ("documented", BodyTwist(0.0, 0.0, 0.8), 1.0),
        ("firmware", BodyTwist(-0.3, 0.0, 0.0), 1.0),
        ("firmware", BodyTwist(0.0, 0.0, 0.8), 0.6),
        ("firmware", BodyTwist(0.0, 0.0, 0.8), 3.0),
    ],
)
def test_a_stall_while_a_wheel_rolls_backward_leaves_the_pose_right(
    firmware: str, twist: BodyTwist, stall_s: float
) -> None:
    """The driver stalls while a wheel rolls backward. The public firmware then counts no ticks.

    After the stall, the error of the position fits the covariance, in each phase of the board's
    timers.
    """
    assert_described(stalled_drives(firmware, stall_s, twist))


@pytest.mark.slow
@pytest.mark.parametrize(("firmware", "stall_s"), [("documented", 6.0), ("firmware", 9.0)])
def test_a_backlog_in_several_reads_leaves_the_pose_right(firmware: str, stall_s: float) -> None:
    """The operating system has kept 64 KiB, and returns 4 KiB in each read. The pose is right."""
    error_m, _ = stalled_drive(Bench(firmware), stall_s, most=65536)
    assert error_m < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("at_s", [0.3, 1.0, 2.5])
def test_a_restart_during_a_stall_ends_the_motion_of_odom(at_s: float) -> None:
    """The driver stalls, and the board restarts meanwhile, so the robot stops.

    The motion in odom ends, too. The covariance covers the error that results from the unknown time
    of the restart.
    """

    def reboot(bench: Bench, since_s: float) -> None:
        if since_s == at_s:
            bench.board.reboot()

    results = stalled_drives("firmware", 3.0, during=reboot)
    assert_described(results)
    assert max(error_m for error_m, _ in results) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("at_s", [4.2, 5.0])
def test_a_restart_at_rest_in_the_second_read_of_a_backlog_moves_nothing(at_s: float) -> None:
    """A restart at rest during a stall does not change the pose.

    The board's clock jumps back every 4.3 s anyway, so only the arrival times show this restart.
    """
    bench = Bench("documented")
    for _ in range(14):
        bench.drive(0.25)
        bench.run(0.1)
    bench.run(1.5)
    error_m, _ = stalled_drive(
        bench,
        7.0,
        BodyTwist(0.0, 0.0, 0.0),
        most=65536,
        during=lambda s: bench.board.reboot() if s == at_s else None,
    )
    assert error_m < 0.06


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "twist", "stall_s"),
    [
        ("documented", BodyTwist(0.2, 0.0, 0.4), 9.0),
        ("firmware", FORWARD, 9.0),
        ("firmware", BodyTwist(-0.2, 0.0, -0.4), 7.0),
    ],
)
def test_a_full_buffer_leaves_an_error_that_the_covariance_describes(
    firmware: str, twist: BodyTwist, stall_s: float
) -> None:
    """The covariance covers the motion in reports that the kernel's full buffer has lost.

    The next counts show the distance and the turn, but not the path.
    """
    bench = Bench(firmware)
    error_m, stddev_m = stalled_drive(bench, stall_s, twist)
    assert error_m < 3 * stddev_m
    assert stddev_m < (0.6 if twist == FORWARD else 1.5)
