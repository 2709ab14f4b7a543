# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The picture of ``calibrate step`` on a LOIS ECU with known motors, made in simulated time."""

import sys
import tempfile
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "core"))
sys.path.append(str(Path(__file__).parents[1] / "tools/lois_ecu"))

from lois_robot import SimulatedRobot, random_motors

from omnibot_driver.tools.calibrate.arguments import command_line
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.files import draw
from omnibot_driver.tools.calibrate.pi_step import run

SEED = 3


def main(folder: Path) -> None:
    """Write ``calibrate_step_lois_ecu.png``."""
    with tempfile.TemporaryDirectory() as scratch:
        robot = SimulatedRobot(Path(scratch), random_motors(SEED), seed=SEED)
        result = run(robot, Console(yes=True), command_line().parse_args(["step", "--yes"]))
    draw(result, folder / "unused.yaml", folder / "calibrate_step_lois_ecu.png")
