# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pictures of ``calibrate imu``, ``scale`` and ``geometry``.

The simulated robots have known errors. docs/tools/calibrate.md lists these errors beside the errors
that the calibrations measure.
"""

import math
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("ROS_DOMAIN_ID", "97")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
sys.path[:0] = [str(Path(__file__).parents[1] / name) for name in ("tools", "core", "system", "")]

from calibrate_rig import rig  # noqa: E402
from surveyor import Surveyor  # noqa: E402

SENSOR = {
    "gyro_bias_dps": (1.2, -0.8, 0.4),
    "gyro_noise_dps": 0.05,
    "gyro_walk_dps": 0.002,
    "accel_bias_g": (0.0, 0.0, -0.02),
    "imu_rpy_rad": (math.radians(181.5), math.radians(-2.0), 0.0),
}
UNITS = {"linear_scale": 80.0, "angular_scale": 430.0}
SIZES = {"wheel_radius_scale": (1.025, 1.02, 1.015), "base_radius_scale": 0.97, "slip": 0.002}


def main(folder: Path) -> None:
    """Write ``calibrate_imu.png``, ``calibrate_scale.png`` and ``calibrate_geometry.png``."""
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        with rig(scratch, **SENSOR) as robot:
            failed = robot.calibrate("imu", "--minutes", "2")
        with rig(scratch, **UNITS) as robot:
            failed |= robot.calibrate("scale")
        with rig(scratch, {"max_angular_speed": 1.0}, **SIZES) as robot:
            surveyor = Surveyor(lambda: robot.port.board)
            quick = ("--turns", "2", "--turning", "1.0", "--speed", "0.3")
            failed |= robot.calibrate("geometry", *quick, answer=surveyor)
        if failed:
            raise RuntimeError("a calibration failed, see above")
        for picture in scratch.glob("*.png"):
            (folder / picture.name).write_bytes(picture.read_bytes())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
