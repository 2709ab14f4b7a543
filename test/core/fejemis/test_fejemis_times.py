# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the stamps of readings.

Some lines contain the Teensy's time. The lines of the IMU do not.
"""

import itertools
import math
import random

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal

from omnibot_driver.core.events import Extra
from omnibot_driver.core.fejemis.imu import ImuSamples
from omnibot_driver.core.fejemis.imu_pairs import ImuPairs, Pair
from omnibot_driver.core.fejemis.messages import Acceleration, Gyro
from omnibot_driver.core.fejemis.readings import OrientedImuReading
from omnibot_driver.core.fejemis.teensy_clock import StampedReadings, TeensyClock
from omnibot_driver.core.readings import ExtraReading, ImuReading
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware


def late(chance: random.Random) -> float:
    """Return a random delay of a read, in s.

    Usually, the delay is about 0.36 ms. For 1 % of the reads, it is up to 20 ms longer.
    """
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
    """Lines arrive late, and some are lost. The stamps have only small errors.

    A constant delay of all stamps is not counted as an error. 99 % of the errors are below 0.05 ms
    for poses, and below 0.2 ms for IMU samples.
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

    Such a restart is hard to notice: the board's time falls by only 0.6 s, so the new lines look
    almost like late lines.
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
    """The clock becomes right, although its first line was read late.

    At first, the clock takes the delay of this line for the usual delay. Later lines that are read
    with less delay seem to arrive too early. The clock rejects the times of at most three lines,
    and then it is right.

    Each later read brings two lines, which were sent 20 ms apart.
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
    """Every third time from the board is damaged: it is 0.1 s too large.

    The damaged times agree with each other, so they could be the times after a jump. But a correct,
    smaller time follows each damaged time. So the clock rejects the damaged times, and stays right.
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
    """The driver reads each port only every 50 ms, so each read brings two or three poses.

    No odometry and no IMU sample is lost. ``seed`` varies how long the robot runs before the driver
    connects, and when the driver first reads each port.
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


def sampled(arrivals: list[float]) -> list[float]:
    """Return the sampling times of IMU samples that arrive at these times, in s.

    The board takes a sample every 10 ms, and a pose every 20 ms.
    """
    imu = ImuSamples("m/s^2")
    return [
        imu.sampled_s(arrived_s, number // 2 * 0.02, math.inf, 0)
        for number, arrived_s in enumerate(arrivals)
    ]


def test_samples_that_waited_for_seconds_have_the_times_at_which_they_were_taken() -> None:
    """The host does not read for 6 s, and all samples of this time arrive together.

    The newest samples of a few seconds usually show the phase of the sampling times. But all
    samples that waited are late, so the phase must stay.
    """
    arrivals = [
        11.0 if 5.0 < 0.01 * number < 11.0 else 0.01 * number + 3e-4 for number in range(1500)
    ]
    errors = [at_s - 0.01 * number for number, at_s in enumerate(sampled(arrivals))]
    assert max(map(abs, errors)) < 1e-3


def test_two_late_samples_do_not_shift_the_sampling_times_of_the_next_ones() -> None:
    """Two successive samples are 17 ms late, and the next one is 7 ms late. No sample is lost.

    After the second sample, it seems as if one sample was lost. The third sample would then be
    3 ms early, and that is impossible. So it shows that no sample was lost.
    """
    late_s = {200: 0.017, 201: 0.017, 202: 0.007}
    arrivals = [0.01 * number + late_s.get(number, 3e-4) for number in range(600)]
    errors = [at_s - 0.01 * number for number, at_s in enumerate(sampled(arrivals))]
    assert max(map(abs, errors[:201] + errors[202:])) < 1e-3


def test_an_early_sample_takes_back_no_more_lost_samples_than_it_must() -> None:
    """Samples are up to 30 ms late, and 10 % of the samples and poses are lost.

    Many samples are lost before one is on time again. If this one is early, only the last loss was
    a mistake. Otherwise the stamps would be several periods too old.
    """
    imu, chance = ImuSamples("m/s^2"), random.Random(2)
    arrived_s, pose_s, errors = 0.0, -math.inf, []
    for number in range(8000):
        true_s = 0.01 * number
        arrived_s = max(arrived_s, true_s + 3e-4 + 0.03 * chance.random() ** 4)
        if number % 2 == 0 and chance.random() >= 0.1:
            pose_s = true_s
        if chance.random() >= 0.1:
            errors.append(imu.sampled_s(arrived_s, pose_s, math.inf, 0) - true_s)
    assert min(errors[400:]) > -0.025


def test_stamps_of_a_kind_go_forward_and_are_not_from_the_future() -> None:
    """The driver makes sure that each stamp is later than the previous stamp of the same kind.

    It also changes a stamp that is in the future: it sets the stamp to the present time.
    """
    stamped = StampedReadings()
    stamped.begin()
    reading = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for stamp_s in (1.0, 0.9, 5.0):
        stamped.add(reading, stamp_s, 2.0)
    stamps = stamped.stamps(stamped.readings, 2.0, None)
    assert stamps == sorted(set(stamps))
    assert stamps[-1] == 2.0


def test_a_sample_has_si_units() -> None:
    """The board sends degrees per second and, on some firmware, g.

    Both are converted to SI units.
    """
    pair = Pair(Gyro(180.0, 0.0, -180.0), Acceleration(0.0, 0.0, 1.0), 1.0, 1.0, 0, doubtful=False)
    reading = ImuSamples("g").reading(pair)
    assert reading.angular_velocity == pytest.approx((math.pi, 0.0, -math.pi))
    assert reading.specific_force == pytest.approx((0.0, 0.0, 9.80665))


@pytest.mark.slow
@pytest.mark.parametrize("sums", [True, False])
def test_the_imu_is_told_a_hundred_times_a_second(*, sums: bool) -> None:
    """The board sends a hundred IMU samples a second.

    Their stamps are 10 ms apart, within 1.5 ms.
    """
    bench = nominal(Simulated(firmware=Firmware(sums=sums)))
    bench.events.clear()
    bench.run(3.0)
    stamps = [estimate.stamp_s for estimate in bench.imu]
    assert len(stamps) == pytest.approx(300, abs=2)
    steps = [b - a for a, b in itertools.pairwise(stamps)]
    assert max(steps) < 0.0115
    assert min(steps) > 0.0085


def test_an_orientation_that_waited_has_the_time_of_its_imu_sample() -> None:
    """The drive board's lines wait for 0.3 s, and then arrive in one read.

    Each orientation still gets the stamp of the IMU sample before it.
    """
    bench = nominal()
    bench.run(3.0)
    waiting = bytearray()

    def wait(channel: int, data: bytes) -> bytes:
        if channel == FRONT:
            return data
        waiting.extend(data)
        return b""

    bench.events.clear()
    bench.carry = wait
    bench.run(0.3)
    bench.carry = lambda channel, data: bytes(waiting) + data if channel == DRIVE else data
    bench.run_until(lambda: bool(bench.imu))
    bench.carry = lambda _, data: data
    bench.run(0.3)
    samples = [estimate.stamp_s for estimate in bench.imu]
    oriented = [
        event.stamp_s
        for event in bench.events
        if isinstance(event, Extra) and isinstance(event.value, OrientedImuReading)
    ]
    assert len(samples) == pytest.approx(60, abs=3)
    assert len(oriented) == pytest.approx(30, abs=2)
    assert max(min(abs(stamp_s - one) for one in samples) for stamp_s in oriented) < 1e-3
    assert min(b - a for a, b in itertools.pairwise(oriented)) > 0.008


def test_stamps_of_each_kind_of_extra_reading_go_forward_by_themselves() -> None:
    """Stamps must increase only among extra readings of the same kind.

    The second reading has an earlier stamp than the first one. It is of another kind, so the driver
    does not change its stamp. The third reading has the kind and the stamp of the first one, so the
    driver makes its stamp later.
    """
    stamped = StampedReadings()
    for content, stamp_s in ((1, 2.0), ("a", 1.0), (1, 2.0)):
        stamped.add(ExtraReading(content), stamp_s, 2.0)
    assert stamped.stamps(stamped.readings, 2.0, None) == pytest.approx([2.0, 1.0, 2.000001])


def test_lines_that_waited_before_the_port_was_opened_are_not_a_restart() -> None:
    """The first lines are old: they waited before the port was opened.

    After the old lines, the board's time jumps ahead. The clock follows the jump. It does not
    report a restart of the board, because a restart would set the board's time back.
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
    """The host stalls. After the stall, many lines of the board arrive at once.

    The board's times in these lines increase, as they did before. So the clock does not report a
    restart.
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


def numbered() -> Bench:
    """Return a bench on which each gyro or acceleration line shows when the board wrote it.

    The board counts its cycles. The x value of a line is the number of the cycle, divided by 1000.
    """
    bench = nominal()
    drive = bench.robot.drive
    drive._items["gyro"] = lambda: f"gyro {drive._cycles % 20_000 / 1000:.3f} 0.100 0.200"
    drive._items["acc"] = lambda: f"acc {drive._cycles % 20_000 / 1000:.4f} 0.1000 9.8000"
    bench.run(0.3)
    bench.events.clear()
    return bench


def cycles_of(bench: Bench) -> list[tuple[float, float]]:
    """Return a pair for each published sample: the cycles of its gyro and its acceleration line.

    A cycle is a period of the board. The lines of a bench from ``numbered`` contain the number of
    the cycle, divided by 1000. The pairs contain the same values.
    """
    return [
        (round(math.degrees(e.angular_velocity[0]), 3), round(e.specific_force[0], 3))
        for e in bench.imu
    ]


@pytest.mark.slow
@pytest.mark.parametrize("kept", ["all", "lost", "twice"])
def test_late_reads_do_not_mix_the_lines_of_two_samples(kept: str) -> None:
    """The two lines of each published sample come from the same cycle of the board.

    The driver reads every 100 ms, so each read has ten samples. In the case "lost", 1 % of the
    lines is lost. In the case "twice", 1 % of the lines comes twice.
    """
    bench = numbered()
    chance = random.Random(5)
    times = {"all": 1, "lost": 0, "twice": 2}[kept]

    def carry(_: int, data: bytes) -> bytes:
        lines = data.splitlines(keepends=True)
        return b"".join(line * (times if chance.random() < 0.01 else 1) for line in lines)

    bench.read_s, bench.carry = 0.1, carry
    bench.run(4.0)
    cycles = cycles_of(bench)
    assert all(gyro == force for gyro, force in cycles)
    assert len(cycles) > (370 if kept == "lost" else 380)


@pytest.mark.slow
@pytest.mark.parametrize("pause_s", [0.001, 0.006])
def test_a_sample_whose_lines_come_in_pieces_is_published(pause_s: float) -> None:
    """The lines arrive in pieces, with pauses that may fall between the two lines of a sample.

    Every sample is published with its own lines.
    """
    bench = numbered()
    chance = random.Random(7)
    unsent, sent_at = bytearray(), bench.now

    def carry(channel: int, data: bytes) -> bytes:
        nonlocal sent_at
        if channel != DRIVE:
            return data
        unsent.extend(data)
        piece = b""
        while unsent and sent_at + pause_s <= bench.now + 1e-9:
            size = chance.randint(1, 60) if pause_s > 0.001 else chance.randint(20, 60)
            piece += bytes(unsent[:size])
            del unsent[:size]
            sent_at += pause_s
        if not unsent:
            sent_at = bench.now
        return piece

    bench.carry = carry
    bench.run(1.0)
    bench.events.clear()
    bench.run(3.0)
    cycles = cycles_of(bench)
    assert all(gyro == force for gyro, force in cycles)
    numbers = [round(gyro * 1000) for gyro, _ in cycles]
    steps = {(b - a) % 20_000 for a, b in itertools.pairwise(numbers)}
    assert steps == {10}
