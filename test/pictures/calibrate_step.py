# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pictures of ``calibrate step`` and ``calibrate commission``, from robots with known errors.

docs/tools/calibrate.md lists these errors, and the errors that the calibration finds.
"""

import math
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("ROS_DOMAIN_ID", "97")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
sys.path.append(str(Path(__file__).parents[1] / "tools"))

from calibrate_rig import rig
from seeing_user import User

from omnibot_driver.simulator.omnibot.motors import MotorConstants

MOTORS = (
    MotorConstants(),
    MotorConstants(pwm_per_count=35.0, time_constant_ticks=10.0, delay_ticks=1),
    MotorConstants(pwm_per_count=60.0, time_constant_ticks=4.0, delay_ticks=3),
)


def main(folder: Path) -> None:
    """Write ``calibrate_step.png`` and ``calibrate_commission.png``."""
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        with rig(scratch, motors=MOTORS) as robot:
            failed = robot.calibrate("step")
        mounted = (math.pi, 0.0, math.pi / 2)
        planted = {"axis_signs": (1, -1, -1), "frame": "body", "imu_rpy_rad": mounted}
        with rig(scratch, **planted) as robot:
            failed |= robot.calibrate("commission", answer=User(robot.port))
        if failed:
            raise RuntimeError("a calibration failed, see above")
        for picture in scratch.glob("*.png"):
            (folder / picture.name).write_bytes(picture.read_bytes())
