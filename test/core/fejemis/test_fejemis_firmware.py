# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what boards send and obey: firmware, checksums, unknown lines, subscriptions."""

import pytest
from fejemis_bench import DRIVE, FRONT, drive_until_refused, nominal

from omnibot_driver.core.fejemis.sums import with_sum
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware


@pytest.mark.slow
@pytest.mark.parametrize("begins", [False, True])
def test_sums_that_begin_or_cease_stop_the_robot_once(*, begins: bool) -> None:
    """While the robot drives, its boards start or stop sending checksums. The robot stops once.

    A new command then moves it as before.
    """
    bench = nominal(Simulated(firmware=Firmware(sums=not begins)))
    bench.drive_on()
    bench.robot.drive.sums = bench.robot.front.sums = begins
    drive_until_refused(bench)
    bench.run(1.2)
    assert bench.robot.standing
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.drive_on()
    assert not bench.robot.standing
    words = "now sends checksums" if begins else "no longer sends checksums"
    assert sum(words in text for text in bench.notices) == 2


def test_help_text_and_unknown_answers_are_no_trouble() -> None:
    """Help text and reports of unknown lines do not disturb the robot.

    The diagnostics show the unknown line.
    """
    bench = nominal()
    bench.robot.receive(b"help\nxyz\n", bench.now, DRIVE)
    bench.robot.receive(b"help\nxyz\n", bench.now, FRONT)
    bench.drive_on()
    assert not bench.robot.standing
    assert bench.board.figures.own["Drive lines unknown"] == "xyz"


def test_the_diagnostics_show_the_latest_unknown_lines() -> None:
    """The diagnostics show the latest three unknown lines, without repetitions."""
    bench = nominal()
    bench.robot.receive(b"wa\nwb\nwc\nwd\nwa\n", bench.now, DRIVE)
    bench.run(0.1)
    assert bench.board.figures.own["Drive lines unknown"] == "wc; wd; wa"


@pytest.mark.slow
@pytest.mark.parametrize("firmware", [
    Firmware(acceleration_in_g=True), Firmware(timed_velocity=True), Firmware(tilt=True),
    Firmware(carriage_return=False), Firmware(single_precision=True), Firmware(confirms=True),
    Firmware(shows_source=False),
])  # fmt: skip
def test_every_kind_of_firmware_is_driven(firmware: Firmware) -> None:
    """The firmware differs in units, in optional fields or in the form of its lines.

    The robot drives as commanded, without faults or notices.
    """
    bench = nominal(Simulated(firmware=firmware))
    bench.drive_on(0.3, 0.2, 0.8)
    assert bench.robot.truth.speed_mps == pytest.approx(0.3, abs=0.01)
    assert bench.board.figures.faults == 0
    assert not bench.notices


@pytest.mark.parametrize(
    ("channel", "text"), [(FRONT, b"sub fwl 100"), (DRIVE, b"sub pose 200"), (DRIVE, b"sub pose 0")]
)
def test_a_slower_subscription_of_another_program_is_replaced(channel: int, text: bytes) -> None:
    """The driver replaces another program's slower subscription to a stream that driving requires.

    Regression: an angle every 100 ms blocked all motion, a pose every 200 ms slowed the odometry.
    """
    bench = nominal()
    bench.robot.receive(with_sum(text) + b"\n", bench.now, channel)
    bench.run(3.0)
    bench.events.clear()
    bench.drive_on(seconds=1.0)
    assert len(bench.odometry) >= 45
    assert bench.odometry[-1].twist is not None
    assert bench.odometry[-1].twist.vx_mps > 0.2
