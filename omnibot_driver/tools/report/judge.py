# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Collects the findings on a log, the most severe first."""

from collections.abc import Iterator

from omnibot_driver.tools.report import events, following, rhythm, sensing, travel
from omnibot_driver.tools.report.findings import Finding, Level
from omnibot_driver.tools.report.log import Log

IMU = "imu/data_raw"
WITHOUT = {
    IMU: "the IMU cannot be judged",
    "odom": "the robot's path is unknown",
}


def judge(log: Log) -> list[Finding]:
    """Return all findings, the most severe first.

    Findings of the same level are in the order in which they were made.
    """
    return sorted(_all(log), key=lambda finding: -finding.level)


def _all(log: Log) -> Iterator[Finding]:
    for trouble in log.troubles:
        yield Finding(Level.BAD, "Recording", f"{trouble[:1].upper()}{trouble[1:]}.")
    absent = set(log.absent)
    if _has_no_imu(log):
        absent.discard(IMU)
    for topic, consequence in WITHOUT.items():
        if topic in absent:
            yield Finding(
                Level.BAD,
                "Recording",
                f"No message of {topic}: {consequence}.",
                "Record this topic as well (ros2 bag record --all), while the state is nominal.",
            )
    others = [topic for topic in log.absent if topic in ("state", "estop_active", "/diagnostics")]
    if others:
        yield Finding(
            Level.NOTE,
            "Recording",
            f"No message of {', '.join(others)}, so the report may show a pause of the board as a"
            " gap or a stop.",
            "Record all topics: ros2 bag record --all.",
        )
    yield from events.judge(log)
    if len(log.imu):
        yield from rhythm.judge(log, log.imu, rhythm.IMU)
    if len(log.odom):
        yield from rhythm.judge(log, log.odom, rhythm.ODOMETRY)
    yield from following.judge(log)
    yield from travel.judge(log)
    yield from sensing.judge(log)


def _has_no_imu(log: Log) -> bool:
    """Return whether the diagnostics show that the board has no IMU.

    For a board with an IMU, the driver's Stream status has values for the IMU. The board has no IMU
    if Stream statuses were recorded, and none of them has such a value.
    """
    streams = [status for status in log.diagnostics if status.name.endswith(": Stream")]
    return bool(streams) and not any("IMU" in key for item in streams for key in item.values)
