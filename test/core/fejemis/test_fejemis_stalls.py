# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of odometry after a stall of the driver, when the lines of several seconds come at once."""

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal

from omnibot_driver.core.geometry.se2 import Pose

READ = 4095
"""Largest number of bytes that wait in a terminal's buffer. A read returns at most this many."""
EVERYTHING = 10**6


def true_pose(bench: Bench) -> Pose:
    truth = bench.robot.truth
    return Pose(truth.x_m, truth.y_m, truth.yaw_rad)


def unread(bench: Bench, seconds: float, *, room: int) -> dict[int, bytes]:
    """Let time pass without reads; return the first ``room`` bytes of each board, by channel.

    Later bytes are lost.
    """
    held = {DRIVE: b"", FRONT: b""}
    for _ in range(round(seconds / bench.robot.tick_s)):
        bench.now += bench.robot.tick_s
        for channel, data in bench.robot.advance():
            held[channel] = (held[channel] + data)[:room]
    return held


def stall(bench: Bench, stall_s: float, *, room: int, noticed: bool = True) -> None:
    """Let the driver stall; then let it read the first ``room`` bytes that each board sent.

    ``noticed``: whether the driver notices the stall; if not, only its reads are late.
    """
    held = unread(bench, stall_s, room=room)
    if noticed:
        bench.session.stood_still(stall_s, bench.now)
    while any(held.values()):
        for channel, data in held.items():
            bench.session.inbound.receive(data[:READ], bench.now, channel)
            bench.settle()
            bench.now += 0.0005
            held[channel] = data[READ:]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noticed", "stall_s", "phase_s"),
    [
        (noticed, (3.3, 4.5)[(n + m) % 2], phase_s)
        for n, noticed in enumerate((True, False))
        for m, phase_s in enumerate((0.0, 0.05) if noticed else (0.03, 0.07))
    ],
)
def test_the_motion_of_a_stall_is_in_odom(noticed: bool, stall_s: float, phase_s: float) -> None:
    """The driver stalls during a drive, and may not notice the stall.

    The odometry then contains the whole motion, and the driver rejects no displacement as
    implausible.
    """
    bench = nominal()
    origin, begin = bench.odometry[-1].pose, true_pose(bench)
    bench.drive_on(0.3, 0.2, 1.0)
    bench.run(phase_s)
    stall(bench, stall_s, room=EVERYTHING, noticed=noticed)
    bench.run(1.2)
    off = origin.way_to(bench.odometry[-1].pose) - begin.way_to(true_pose(bench))
    assert off.way_m < 0.01
    assert abs(off.yaw_rad) < 0.01
    assert not any("implausible" in notice for notice in bench.notices)


@pytest.mark.slow
@pytest.mark.parametrize("stall_s", [0.8, 2.0])
@pytest.mark.parametrize("room", [READ, EVERYTHING])
def test_samples_that_waited_get_their_sampling_times(room: int, stall_s: float) -> None:
    """After a stall, all samples in the terminal's buffer are published with their sampling times.

    In one case, the buffer is full after 0.37 s. In the other case, it holds all lines of the
    stall.
    """
    bench = nominal()
    bench.run(1.0)
    begin_s, before = bench.now, len(bench.imu)
    stall(bench, stall_s, room=room)
    bench.run(0.02)  # the next pose confirms the last samples
    stamps_s = [estimate.stamp_s - begin_s for estimate in bench.imu[before:]]
    count = 37 if room == READ else round(100 * stall_s)
    assert stamps_s[:count] == pytest.approx([0.01 * (n + 1) for n in range(count)], abs=2e-3)
    assert not any("silent" in notice for notice in bench.notices)


@pytest.mark.slow
@pytest.mark.parametrize("stall_s", [0.8, 1.5])
def test_samples_of_a_second_late_read_get_their_sampling_times_too(stall_s: float) -> None:
    """The driver stalls, and the terminal's full buffer loses bytes. Then a second read is late.

    The published samples have their sampling times. Only a sample before the next pose is not
    published.
    """
    bench = nominal()
    bench.run(1.0)
    begin_s, before = bench.now, len(bench.imu)
    stall(bench, stall_s, room=READ)
    for channel, data in unread(bench, 0.3, room=READ).items():
        bench.session.inbound.receive(data, bench.now, channel)
    bench.settle()
    bench.run(0.52)  # the last pose confirms the sample before it
    stamps_s = [estimate.stamp_s - begin_s for estimate in bench.imu[before:]]
    taken = [*range(1, 38), *range(round(100 * stall_s) + 2, round(100 * stall_s) + 81)]
    assert stamps_s[: len(taken)] == pytest.approx([n / 100 for n in taken], abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("stall_s", [0.8, 0.81, 2.01])
def test_no_sample_after_lost_bytes_gets_a_time_at_which_they_were_lost(stall_s: float) -> None:
    """The driver stalls, and the terminal's full buffer loses bytes until the end of the stall.

    No published sample has a stamp from the time in which bytes were lost.
    """
    bench = nominal()
    bench.run(1.0)
    begin_s, before = bench.now, len(bench.imu)
    stall(bench, stall_s, room=READ)
    bench.run(0.3)
    stamps_s = [estimate.stamp_s - begin_s for estimate in bench.imu[before:]]
    assert len(stamps_s) >= 37 + 25
    assert not [stamp_s for stamp_s in stamps_s if 0.375 < stamp_s < stall_s - 2e-3]
