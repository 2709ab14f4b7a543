# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Collects the findings on a log, the most severe first."""

from collections.abc import Iterator

from omnibot_driver.tools.report import clocks, events, following, rhythm, sensing, streams, travel
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
    for topic, consequence in WITHOUT.items():
        level = _missing_imu(log) if topic == IMU else Level.BAD
        if topic in log.absent and level > Level.GOOD:
            yield Finding(
                level,
                "Recording",
                f"No message of {topic}: {consequence}."
                if level is Level.BAD
                else f"No topic {topic}. If this robot has an IMU, the recording lacks it.",
                "Record this topic as well (ros2 bag record --all), while the state is nominal."
                if level is Level.BAD
                else "",
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
    stepped = clocks.step(log)
    if stepped is not None:
        yield from clocks.judge(stepped)
        if stepped.recorders:
            log = clocks.by_stamp(log)
    yield from events.judge(log)
    if len(log.imu):
        yield from rhythm.judge(log, log.imu, streams.IMU)
    if len(log.odom):
        yield from rhythm.judge(log, log.odom, streams.ODOMETRY)
    if stepped is None:
        yield from following.judge(log)
    yield from travel.judge(log)
    yield from sensing.judge(log)


def _missing_imu(log: Log) -> Level:
    """Return the level of the finding that the log has no message of the IMU.

    * GOOD: the driver's status "Stream" shows that the board has no IMU.
    * BAD: this status or a topic shows an IMU, or the log is of a single robot and does not contain
      this status.
    * NOTE: otherwise.
    """
    streams = [status for status in log.diagnostics if status.name.endswith(": Stream")]
    told = {any("IMU" in key for key in status.values) for status in streams}
    if told == {False}:
        return Level.GOOD
    known = told == {True} or IMU in log.topics or (log.alone and not told)
    return Level.BAD if known else Level.NOTE
