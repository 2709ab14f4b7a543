# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A MART robot one of whose motors is still on after a straight move."""

from mart_bench import MartBench

from omnibot_driver.core.mart.states import Motion
from omnibot_driver.simulator.mart import Firmware

OFF = (128, 128)
BOTH = [b"MCS 128 128", b"MSM"]


def registers(bench: MartBench) -> tuple[int, int]:
    return bench.server.chassis.right, bench.server.chassis.left


def creeping(firmware: Firmware = "source") -> MartBench:
    """Return a test bench whose robot has just driven straight. Its left motor is still on."""
    bench = MartBench(firmware).ready()
    bench.go_to(0.5, 0.0, 0.0)
    pilot = bench.board._pilot
    bench.run_until(lambda: pilot.motion is Motion.STRAIGHT, 10.0)
    bench.run_until(lambda: pilot.motion is Motion.NONE, 10.0)
    bench.server.drive(128, 127)
    return bench
