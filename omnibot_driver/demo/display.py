# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Prints the demo's rows, texts and picture.

The module knows terminals; it must not know ROS or processes.
"""

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import zip_longest
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.demo.capability import Capability
from omnibot_driver.tools.monitor.plot import draw_path

HEADING: Final = """\
             rates Hz        pose by odom       commanded          measured
state        imu odom lap   x m   y m yaw° x m/s y m/s rad/s x m/s y m/s rad/s"""

CLOSING: Final = """
To use a real robot, first lift its wheels off the ground ({page}). Then run
  ros2 run omnibot_driver driver --ros-args """


def status_row(
    state: str, rates_hz: tuple[int | None, int], leg: int, pose: Pose, *velocities: BodyTwist
) -> str:
    """Return a row of the table under ``HEADING``: state, rates, lap, pose and velocities.

    ``rates_hz``: IMU (None without one) and odometry. ``leg``: number of completed sides of the
    square, over all laps. ``velocities``: commanded and measured.
    """
    imu_hz, odom_hz = rates_hz
    numbers = [(pose.x_m, 6, 2), (pose.y_m, 6, 2), (_degrees(pose.yaw_rad), 5, 0)]
    for twist in velocities:
        numbers += [(v, 6, 2) for v in (twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps)]
    # Adding 0.0 makes a rounded -0.0 positive.
    columns = [
        f"{round(value, places) + 0.0:{width}.{places}f}" for value, width, places in numbers
    ]
    imu = "-" if imu_hz is None else imu_hz
    return f"{state:<12}{imu:>4}{odom_hz:5d}{leg // 4 + 1:4d}" + "".join(columns)


def _degrees(angle_rad: float) -> float:
    return math.degrees(math.remainder(angle_rad, math.tau))


def introduce(
    capability: Capability,
    options: tuple[str, str],
    namespace: str,
    exports: str,
    seconds: float,
) -> None:
    """Print what the demo does, and commands that the user can try.

    ``options``: a text with the simulator's arguments, and one with the driver's arguments.

    ``exports``: environment variables for the user's shell.
    """
    imu = f"\n  ros2 topic hz {namespace}/imu/data_raw" * capability.imu
    turning = (
        "turning as only an omni robot can" if capability.sideways else "turning at its corners"
    )
    ending = f"for {seconds:g} s" if math.isfinite(seconds) else "until ctrl-C"
    print(f"""\
A simulated {capability.title} drives a square of 1 m, {turning}.

  simulator  python -m omnibot_driver.simulator{options[0]}
  driver     python -m omnibot_driver.driver --ros-args {options[1]}
  demo       reads odom and steers with cmd_vel, {ending}

In another terminal with ROS 2 Jazzy, you can watch and stop the robot:

  export {exports}{imu}
  ros2 topic echo {namespace}/odom --field pose.pose
  ros2 service call {namespace}/omnibot_driver/estop \\
    std_srvs/srv/SetBool "data: true"    # then "data: false"
""")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """The results of a drive.

    ``way_m``: distance driven.

    ``laps``: number of driven laps of the square.

    ``pose``, ``true_pose``: the robot's last pose. ``pose`` is from the odometry, and ``true_pose``
    is from the simulation.

    ``points``: the driven path, as x and y in m.

    ``page``: path of the document about the board, which the last text of the demo names.

    ``real``: arguments after ``--ros-args`` with which the user starts the driver for a real robot.
    """

    seconds: float
    way_m: float
    laps: float
    imu_hz: float | None
    odom_hz: float
    pose: Pose
    true_pose: Pose
    points: Iterable[tuple[float, float]]
    real: str
    page: str


def report(drive: Drive) -> None:
    """Print the results and the error of the pose; on a terminal, print also the path."""
    pose, true_pose = drive.pose, drive.true_pose
    error_mm = 1000 * math.dist((pose.x_m, pose.y_m), (true_pose.x_m, true_pose.y_m))
    error_deg = abs(_degrees(pose.yaw_rad - true_pose.yaw_rad))
    imu = "" if drive.imu_hz is None else f"imu {drive.imu_hz:.1f} Hz, "
    laps = f"{drive.laps:g} lap{'' if drive.laps == 1.0 else 's'}"
    text = [
        f"driven      {drive.way_m:.2f} m in {drive.seconds:.1f} s, {laps}",
        f"received    {imu}odom {drive.odom_hz:.1f} Hz",
        *(
            f"{name:<10}{p.x_m:8.3f} m {p.y_m:8.3f} m {_degrees(p.yaw_rad):7.1f}°"
            for name, p in (("odometry", pose), ("truth", true_pose))
        ),
        f"pose error  {error_mm:.1f} mm, {error_deg:.2f}°",
    ]
    print()
    if sys.stdout.isatty():
        rows = zip_longest(draw_path(drive.points, 24, 12).rows, ["", "", "", *text], fillvalue="")
        text = ["", *(f"{drawn:28}{line}".rstrip() for drawn, line in rows)]
    print(*text, CLOSING.format(page=drive.page) + drive.real, sep="\n")
