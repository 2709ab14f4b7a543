# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of IMU samples: when they were taken, and which lines belong to one sample.

The lines of the IMU do not contain the Teensy's time.
"""

import itertools
import math
import random

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal

from omnibot_driver.core.events import Extra
from omnibot_driver.core.fejemis.imu import ImuSamples
from omnibot_driver.core.fejemis.imu_pairs import Pair
from omnibot_driver.core.fejemis.messages import Acceleration, Gyro
from omnibot_driver.core.readings import OrientedImuReading
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware


def sampled(arrivals: list[float]) -> list[float]:
    """Return the driver's sampling times for IMU samples with these arrival times, all in s.

    The board takes a sample every 10 ms, and a pose every 20 ms.
    """
    imu = ImuSamples("m/s^2")
    return [
        imu.sampled_s(arrived_s, number // 2 * 0.02, math.inf, 0)
        for number, arrived_s in enumerate(arrivals)
    ]


def test_samples_that_waited_for_seconds_have_the_times_at_which_they_were_taken() -> None:
    """IMU samples wait for up to 6 s, and are read together. The driver finds their sampling times.

    The late samples do not shift the sampling times of later samples.
    """
    arrivals = [
        11.0 if 5.0 < 0.01 * number < 11.0 else 0.01 * number + 3e-4 for number in range(1500)
    ]
    errors = [at_s - 0.01 * number for number, at_s in enumerate(sampled(arrivals))]
    assert max(map(abs, errors)) < 1e-3


def test_two_late_samples_do_not_shift_the_sampling_times_of_the_next_ones() -> None:
    """Two samples arrive 17 ms late, as if one were lost. The next one arrives only 7 ms late.

    After a loss, it would seem at least 10 ms late, so no later sampling time is shifted.
    """
    late_s = {200: 0.017, 201: 0.017, 202: 0.007}
    arrivals = [0.01 * number + late_s.get(number, 3e-4) for number in range(600)]
    errors = [at_s - 0.01 * number for number, at_s in enumerate(sampled(arrivals))]
    assert max(map(abs, errors[:201] + errors[202:])) < 1e-3


def test_an_early_sample_takes_back_no_more_lost_samples_than_it_must() -> None:
    """Samples are lost or late, and the driver has counted too many as lost.

    When a sample seems too early, the driver reduces this count. It does not reduce the count so
    far that a stamp becomes several periods too old.
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


def numbered() -> Bench:
    """Return a bench on which each gyro or acceleration line shows the board's cycle.

    The x value of a line is the number of the cycle, divided by 1000.
    """
    bench = nominal()
    drive = bench.robot.drive
    drive._items["gyro"] = lambda: f"gyro {drive._cycles % 20_000 / 1000:.3f} 0.100 0.200"
    drive._items["acc"] = lambda: f"acc {drive._cycles % 20_000 / 1000:.4f} 0.1000 9.8000"
    bench.run(0.3)
    bench.events.clear()
    return bench


def cycles_of(bench: Bench) -> list[tuple[float, float]]:
    """Return the cycle numbers of the gyro line and acceleration line of each published sample.

    The numbers are divided by 1000. ``bench`` must be a result of ``numbered``, whose lines contain
    these numbers.
    """
    return [
        (round(math.degrees(e.angular_velocity[0]), 3), round(e.specific_force[0], 3))
        for e in bench.imu
    ]


@pytest.mark.slow
@pytest.mark.parametrize("kept", ["all", "lost", "twice"])
def test_late_reads_do_not_mix_the_lines_of_two_samples(kept: str) -> None:
    """Each read has ten samples, and 1 % of the lines may be lost or repeated.

    The two lines of each published sample come from the same cycle of the board.
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
