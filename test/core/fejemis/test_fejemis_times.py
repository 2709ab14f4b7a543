# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the stamps of readings, and of the driver's estimate of the Teensy's clock.

Some lines contain the Teensy's time. The lines of the IMU do not.
"""

import math
import random

import pytest
from fejemis_bench import DRIVE, FRONT, Bench

from omnibot_driver.core.fejemis.imu import ImuSamples
from omnibot_driver.core.fejemis.imu_pairs import ImuPairs, Pair
from omnibot_driver.core.fejemis.messages import Acceleration, Gyro
from omnibot_driver.core.fejemis.teensy_clock import StampedReadings, TeensyClock
from omnibot_driver.core.readings import ExtraReading, ImuReading


def late(chance: random.Random) -> float:
    """Return a random delay of a read, in s: about 0.36 ms; in 1 % of cases, up to 20 ms more."""
    stall_s = chance.uniform(0.0, 0.02) if chance.random() < 0.01 else 0.0
    return 3e-4 + chance.expovariate(1 / 6e-5) + stall_s


def within(errors: list[float]) -> float:
    """Return half the width, in s, of the narrowest interval that contains 99 % of the errors."""
    errors = sorted(errors)
    most = int(0.99 * len(errors))
    return min(b - a for a, b in zip(errors, errors[most:], strict=False)) / 2


@pytest.mark.parametrize("ppm", [-100.0, 0.0, 100.0])
@pytest.mark.parametrize("loss", [0.0, 0.03])
def test_stamps_are_those_of_the_board(ppm: float, loss: float) -> None:
    """Although lines are late or lost, stamps have small errors, apart from a constant delay.

    99 % of the errors are below 0.05 ms for poses, and below 0.2 ms for IMU samples.
    """
    chance = random.Random(f"{ppm} {loss}")
    clock, imu, pairs = TeensyClock(), ImuSamples("m/s^2"), ImuPairs()
    phase_s, start_s = chance.random() * 0.01, chance.random() * 50
    samples = sorted(
        [(n * 0.02 + 0.0031, "pose") for n in range(20 * 50)]
        + [(n * 0.01 + phase_s, "imu") for n in range(20 * 100)]
    )
    off: dict[str, list[float]] = {"pose": [], "imu": []}
    arrived = pose_s = -math.inf
    for true_s, kind in samples:
        board_s = start_s + true_s * (1.0 + ppm * 1e-6)
        arrived = max(arrived, true_s + late(chance))
        if kind == "pose" and chance.random() >= loss:
            pose_s = round(board_s, 5)
            assert clock.see(pose_s, arrived)
            pairs.pose(pose_s)
            off["pose"].append(clock.host_s(pose_s) - true_s)
        elif kind == "imu":
            if chance.random() >= loss:
                pairs.gyro(Gyro(true_s, 0.0, 0.0), arrived)
            if chance.random() >= loss:
                pairs.acceleration(Acceleration(true_s, 0.0, 9.8), arrived)
            for pair in pairs.take():
                assert isinstance(pair, Pair)
                assert pair.at == arrived
                sampled_s = imu.sampled_s(
                    clock.board_s(pair.at), pair.pose_s, pair.next_pose_s, pair.skipped
                )
                off["imu"].append(min(arrived, clock.host_s(sampled_s)) - true_s)
    assert within(off["pose"][200:]) < 5e-5
    assert within(off["imu"][400:]) < 2e-4
    assert clock.skew_ppm == pytest.approx(ppm, abs=8.0)


def test_a_time_that_cannot_be_the_boards_is_refused() -> None:
    """The clock ignores a single implausible time of the board.

    Several implausible times that agree with each other show a restart of the board.
    """
    clock = TeensyClock()
    assert all(clock.see(100.0 + 0.02 * n, 5.0 + 0.02 * n) for n in range(50))
    assert not clock.see(10.98, 6.0)
    assert clock.see(101.02, 6.02)
    assert not clock.see(0.1, 6.1)
    assert not clock.see(0.12, 6.12)
    assert not clock.see(0.14, 6.14)
    assert clock.see(0.16, 6.16)
    assert clock.restarted


def test_a_board_that_restarts_soon_after_its_start_is_noticed() -> None:
    """The clock notices that a board has restarted soon after its start.

    The board's time falls by only 0.6 s, so the new lines could also be late lines.
    """
    clock = TeensyClock()
    assert all(clock.see(0.1 + 0.02 * n, 5.0 + 0.02 * n) for n in range(30))
    restarts = 0
    for n in range(10):
        clock.see(0.1 + 0.02 * n, 5.7 + 0.02 * n)
        restarts += clock.restarted
    assert restarts == 1
    assert clock.host_s(0.28) == pytest.approx(5.88, abs=0.01)


@pytest.mark.parametrize("waited_s", [0.012, 0.03, 0.2])
def test_a_clock_that_began_with_a_late_line_recovers(waited_s: float) -> None:
    """A clock that began with a late line becomes right, and rejects at most three lines meanwhile.

    Lines with less delay seem too early at first.
    """
    clock = TeensyClock()
    clock.see(100.0, 5.0 + waited_s)
    arrivals = [
        (0.04 * read + 0.02 * line, 0.04 * read + 0.02) for read in range(50) for line in (0, 1)
    ]
    lost = [not clock.see(100.3 + sent_s, 5.3 + read_s) for sent_s, read_s in arrivals]
    assert sum(lost) <= 3
    assert not any(lost[10:])
    assert clock.host_s(110.0) == pytest.approx(15.0, abs=0.001)


def test_damaged_times_ahead_of_the_clock_do_not_move_it() -> None:
    """Every third time of the board is damaged and 0.1 s too large. The clock does not move.

    The correct times between the damaged ones show that the board's time has not jumped.
    """
    clock = TeensyClock()
    for n in range(100):
        damaged = n % 3 == 2
        assert clock.see(100.0 + 0.02 * n + 0.1 * damaged, 5.0 + 0.02 * n) is not damaged
        assert not clock.restarted
    assert clock.host_s(102.0) == pytest.approx(7.0, abs=0.001)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_rare_reads_lose_no_odometry(seed: int) -> None:
    """No odometry and no IMU sample is lost if the driver reads each port only every 50 ms.

    ``seed`` varies the time before the connection, and the phase of the reads.
    """
    bench, chance = Bench(), random.Random(seed)
    for _ in range(chance.randrange(2000)):
        bench.now += bench.robot.tick_s
        bench.robot.advance()
    bench.read_s = 0.05
    bench._read_at = [bench.now - chance.uniform(0.0, 0.05) for _ in (DRIVE, FRONT)]
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.0)
    bench.events.clear()
    bench.run(2.0)
    assert len(bench.odometry) == pytest.approx(100, abs=3)
    assert len(bench.imu) == pytest.approx(200, abs=6)


def test_stamps_of_a_kind_go_forward_and_are_not_from_the_future() -> None:
    """Each stamp is later than the previous one of its kind, and not in the future.

    A stamp in the future is set to the present time.
    """
    stamped = StampedReadings()
    stamped.begin()
    reading = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for stamp_s in (1.0, 0.9, 5.0):
        stamped.add(reading, stamp_s, 2.0)
    stamps = stamped.stamps(stamped.readings, 2.0, None)
    assert stamps == sorted(set(stamps))
    assert stamps[-1] == 2.0


def test_stamps_of_each_kind_of_extra_reading_go_forward_by_themselves() -> None:
    """Stamps of board-specific readings (``ExtraReading``) increase within each type of content.

    A stamp equal to the last one of its type becomes 1 µs later. Stamps of other types have no
    effect.
    """
    stamped = StampedReadings()
    for content, stamp_s in ((1, 2.0), ("a", 1.0), (1, 2.0)):
        stamped.add(ExtraReading(content), stamp_s, 2.0)
    assert stamped.stamps(stamped.readings, 2.0, None) == pytest.approx([2.0, 1.0, 2.000001])


def test_lines_that_waited_before_the_port_was_opened_are_not_a_restart() -> None:
    """Lines waited before the port was opened. The driver does not regard them as a restart.

    After these old lines, the board's time jumps ahead, and the fitted clock follows the jump.
    """
    clock = TeensyClock()
    for n in range(20):
        clock.see(5.0 + 0.02 * n, 100.0 + 1e-4 * n)
    followed, restarts = [], 0
    for n in range(10):
        followed.append(clock.see(10.0 + 0.02 * n, 100.02 + 0.02 * n))
        restarts += clock.restarted
    assert followed[-1]
    assert not restarts
    assert clock.host_s(10.18) == pytest.approx(100.2, abs=0.01)


def test_what_waited_while_the_host_was_stalled_is_not_a_restart() -> None:
    """Many lines that arrive at once after a stall of the host are not regarded as a restart.

    The board's times still increase.
    """
    clock = TeensyClock()
    for n in range(100):
        assert clock.see(5.0 + 0.02 * n, 100.0 + 0.02 * n)
    waited = [clock.see(7.0 + 0.02 * n, 104.0 + 1e-4 * n) for n in range(100)]
    assert not waited[0]
    assert waited[-1]
    assert not clock.restarted
    assert clock.host_s(9.0) == pytest.approx(104.0, abs=0.01)
    for n in range(10):
        clock.see(0.5 + 0.02 * n, 105.0 + 0.02 * n)
        if clock.restarted:
            break
    assert 2 <= n <= 4
