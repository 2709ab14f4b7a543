# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Errors of the odometry of a LOIS ECU, and NEES, in many simulated drives.

``python test/integrity/lois_odometry.py --drives 50 --seed 5000`` prints a table. Seeds below 4000
were used for tuning.

``--nominal``: the wheels have the assumed size.

``--gains boot``: the controllers keep the board's gains.

``--late``: the computer reads only once in 0.05 to 0.35 s.

``--loss 0.01``: one byte in a hundred is lost, in either direction.

``--own-periods``: the board keeps its own period of 400 ms for ticks and odometry. Without this
option, the driver sets the period to 200 ms.
"""

import argparse
import math
import sys
from pathlib import Path
from statistics import mean

sys.path.insert(0, str(Path(__file__).parents[1] / "core" / "lois_ecu"))

from lois_drives import HOST_GAINS, LATE_READS_S, MOTIONS, VARIED, motion, nominal, wrong

from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import QUIRKS


def main() -> None:
    """Print one row for each motion and firmware."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--firmware", choices=tuple(QUIRKS), action="append")
    parser.add_argument("--motion", choices=MOTIONS + VARIED, action="append")
    parser.add_argument("--gains", choices=("host", "boot"), default="host")
    parser.add_argument("--nominal", action="store_true")
    parser.add_argument("--late", action="store_true")
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--own-periods", action="store_true")
    wanted = parser.parse_args()
    ours = HOST_GAINS if wanted.gains == "host" else LoisEcuSettings()
    reads_s = LATE_READS_S if wanted.late else (0.0, 0.0)
    robot = nominal if wanted.nominal else wrong
    seeds = range(wanted.seed, wanted.seed + wanted.drives)
    print(
        "| Firmware | Motion | Way, turn | Off by, mean (greatest) | Heading | NEES | Beyond 3 σ |"
    )
    print("|---|---|---|---|---|---|---|")
    for firmware in wanted.firmware or QUIRKS:
        for name in wanted.motion or VARIED:
            drives = [
                motion(
                    robot(firmware, seed),
                    name,
                    ours,
                    loss=wanted.loss,
                    reads_s=reads_s,
                    own_periods=wanted.own_periods,
                )
                for seed in seeds
            ]
            off = [math.hypot(one.error.x_m, one.error.y_m) for one in drives]
            turned = [abs(math.degrees(one.error.yaw_rad)) for one in drives]
            nees = [one.nees for one in drives]
            print(
                f"| {firmware} | {name} | {mean(one.way_m for one in drives):.1f} m,"
                f" {math.degrees(mean(one.turned_rad for one in drives)):.0f}° |"
                f" {mean(off):.3f} m ({max(off):.3f}) | {mean(turned):.1f}° ({max(turned):.1f}) |"
                f" {mean(nees):.1f} (greatest {max(nees):.0f}) |"
                f" {sum(one.sigmas > 3 for one in drives)} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
