# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that stamps still increase after they are rounded to the nanosecond, as in ROS."""

import itertools
import random
from collections import defaultdict

import pytest
from fejemis_bench import Bench

from omnibot_driver.core.events import Extra
from omnibot_driver.core.fejemis.teensy_clock import StampedReadings
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.readings import ImuReading


def test_two_stamps_never_differ_only_by_a_rounding_error() -> None:
    """Two stamps differ by a rounding error. The driver sets the second 1 µs after the first."""
    stamped = StampedReadings()
    reading = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for stamp_s in (50_000.0, 50_000.000000000007):
        stamped.add(reading, stamp_s, 50_000.1)
    first_s, second_s = stamped.stamps(stamped.readings, 50_000.1, None)
    assert first_s == 50_000.0
    assert second_s == pytest.approx(50_000.000001, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 17])
def test_stamps_in_nanoseconds_increase_after_restarts_that_are_read_late(seed: int) -> None:
    """The boards restart, and the driver reads late. Stamps of each kind of message still increase.

    The stamps are compared in nanoseconds. The first lines after such a restart all have the time
    of the read.
    """
    chance = random.Random(seed)
    bench = Bench()
    bench.now = chance.uniform(3e4, 1e5)
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    for _ in range(3):
        bench.read_s = chance.uniform(0.1, 0.5)
        bench.robot.reboot()
        bench.run(2.0)
    stamps_ns: defaultdict[type, list[int]] = defaultdict(list)
    for event in bench.events:
        if isinstance(event, ImuEstimate | OdometryEstimate | Extra):
            kind = type(event.value) if isinstance(event, Extra) else type(event)
            stamps_ns[kind].append(round(event.stamp_s * 1e9))
    assert {ImuEstimate, OdometryEstimate} <= stamps_ns.keys()
    for kind, stamps in stamps_ns.items():
        for before, after in itertools.pairwise(stamps):
            assert before < after, kind
