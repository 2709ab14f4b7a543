# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the diagnostics: each fault changes its own status, which later returns to OK."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from omnibot_driver.core.board import BoardFigures, RateName
from omnibot_driver.core.measurement.outlier_filter import Refused
from omnibot_driver.core.measurement.statistics import StreamStatistics
from omnibot_driver.core.reporting.diagnosis import Diagnosis
from omnibot_driver.core.reporting.figures import (
    CommandFigures,
    ImuFigures,
    LinkFigures,
    Refusals,
    SessionFigures,
)
from omnibot_driver.core.reporting.recent import RECENT_S
from omnibot_driver.core.reporting.status import Level, Status

NAMES = ["Link", "Board", "Stream", "Time", "Commands", "E-stop", "IMU"]
Change = Callable[["Robot"], None]


class Robot:
    """A healthy robot, described by the figures for its diagnosis.

    ``seconds`` lets seconds pass, and makes a diagnosis in each of them.
    """

    def __init__(self) -> None:
        self.diagnosis = Diagnosis("its power, cable and baudrate")
        self.now = 1000.0
        self.link = LinkFigures(port="/dev/ttyUSB0", opened=1)
        self.refusals = Refusals()
        self.per_second = {"imu": 100, "displacements": 25, "poses": 5}
        self.delay_s = 0.001
        self.figures = SessionFigures(
            state="nominal",
            tally=StreamStatistics(),
            board=BoardFigures(rates_hz={"IMU": 100.0, "Odometry": 25.0, "Pose": 5.0}),
            refused=Refused(0, 0, 0),
            skew_ppm=20.0,
            commands=CommandFigures(),
            imu=ImuFigures(bias_radps=(0.0, 0.0, 0.0), gravity_mps2=9.8),
        )
        self.statuses: dict[str, Status] = {}
        self.seconds(3)

    def seconds(self, count: int) -> None:
        for _ in range(count):
            self.now += 1.0
            tally = replace(self.figures.tally)
            for name, rate in self.per_second.items():
                setattr(tally, name, getattr(tally, name) + rate)
            tally.reads += 100
            tally.delay_s += 100 * self.delay_s
            tally.squared_delay_s2 += 100 * self.delay_s**2
            self.set(tally=tally)
            found = self.diagnosis.judge(self.link, self.figures, self.refusals, self.now)
            assert [status.name for status in found] == NAMES
            self.statuses = {status.name: status for status in found}

    def set(self, **values: object) -> None:
        self.figures = replace(self.figures, **values)  # type: ignore[arg-type]

    def count(self, **values: int) -> None:
        self.set(tally=replace(self.figures.tally, **values))

    def board(self, **values: int) -> None:
        self.set(board=replace(self.figures.board, **values))

    def command(self, **values: object) -> None:
        self.set(commands=CommandFigures(**values))  # type: ignore[arg-type]

    def refuse(self, why: str) -> None:
        self.refusals = Refusals(count=self.refusals.count + 1, last=why)

    def sensor(self, **values: object) -> None:
        self.set(imu=replace(self.figures.imu, **values))

    def connect(self, **values: object) -> None:
        self.link = replace(self.link, **values)  # type: ignore[arg-type]

    @property
    def troubles(self) -> dict[str, Level]:
        return {name: s.level for name, s in self.statuses.items() if s.level is not Level.OK}


def test_a_healthy_robot_is_all_ok() -> None:
    """The robot is healthy. All statuses are OK and show rates, skew, delay and gravity."""
    robot = Robot()
    assert not robot.troubles
    stream, time = robot.statuses["Stream"].values, robot.statuses["Time"].values
    assert stream["IMU rate (Hz)"] == "100.0 of 100"
    assert stream["Pose rate (Hz)"] == "5.0 of 5"
    assert time == {
        "Clock skew (ppm)": "20.0", "Delay above minimum (ms)": "1.00", "Jitter (ms rms)": "0.00",
    }  # fmt: skip
    assert robot.statuses["IMU"].values["Gravity (m/s²)"] == "9.800"
    assert robot.statuses["Commands"].message == "idle"


FAULTS: list[tuple[Change, str, Level, str]] = [
    (lambda r: r.connect(opened=2), "Link", Level.WARN, "check cable, hub and power"),
    (lambda r: r.connect(trouble="no permission"), "Link", Level.ERROR, "no permission"),
    (lambda r: r.connect(opened=0), "Link", Level.STALE, "being opened"),
    (lambda r: r.count(restarts=1), "Board", Level.WARN, "check its power supply"),
    (lambda r: r.board(faults=1), "Stream", Level.WARN, "check cable, hub and ground"),
    (lambda r: r.count(gaps=1), "Stream", Level.WARN, "check cable, hub and ground"),
    (lambda r: r.connect(overruns=1), "Stream", Level.WARN, "in this computer, not on the line"),
    (lambda r: r.set(refused=Refused(0, 1, 0)), "Stream", Level.WARN, "set too low"),
    (lambda r: r.per_second.update(imu=80), "Stream", Level.WARN, "too busy"),
    (lambda r: r.per_second.update(imu=120), "Stream", Level.WARN, "too busy"),
    (lambda r: r.per_second.update(displacements=20), "Stream", Level.WARN, "too busy"),
    (lambda r: r.per_second.update(poses=3), "Stream", Level.WARN, "too busy"),
    (lambda r: setattr(r, "delay_s", 0.02), "Time", Level.WARN, "latency_timer"),
    (lambda r: r.refuse("why"), "Commands", Level.WARN, "lately: why"),
    (lambda r: r.board(saturated=1), "Commands", Level.WARN, "lower the scales"),
    (lambda r: r.command(trips=1), "Commands", Level.WARN, "the motion monitor has stopped"),
    (lambda r: r.command(monitored=False), "Commands", Level.WARN, "the motion monitor is off"),
    (lambda r: r.command(interlock="why"), "Commands", Level.ERROR, "motion is refused: why"),
    (lambda r: r.command(estop=True), "E-stop", Level.WARN, "~/estop (data: false)"),
    (lambda r: r.count(same_rate=100), "IMU", Level.ERROR, "identical readings from the gyro"),
    (lambda r: r.count(same_force=100, same_rate=100), "IMU", Level.ERROR, "accelerometer and"),
    (lambda r: r.sensor(advice="set `accel_range` to 4"), "IMU", Level.WARN, "`accel_range` to 4"),
]  # fmt: skip


@pytest.mark.parametrize(("fault", "name", "level", "said"), FAULTS)
def test_each_fault_alone_raises_its_own_status(
    fault: Change, name: str, level: Level, said: str
) -> None:
    """One fault occurs. Only its own status changes, and its message says what to do."""
    robot = Robot()
    fault(robot)
    robot.seconds(5)
    assert robot.troubles == {name: level}
    assert said in robot.statuses[name].message


def test_a_board_of_which_a_line_is_missing_is_not_said_to_be_silent() -> None:
    """A board has several ports, and one is missing. The status names the missing port.

    The status does not call the board silent.
    """
    robot = Robot()
    robot.connect(trouble="the port 'front' is missing: unplugged")
    robot.set(state="connecting")
    robot.seconds(1)
    assert robot.troubles["Link"] is Level.ERROR
    assert robot.statuses["Board"].level is Level.STALE
    assert "a port of the board is missing" in robot.statuses["Board"].message


def test_what_only_a_board_has_to_show_stands_with_its_mode() -> None:
    """A board has further diagnostic values, for example a version and its own odometry rate.

    The diagnostics show these values.
    """
    robot = Robot()
    assert "Published odometry (Hz)" not in robot.statuses["Stream"].values
    robot.set(board=replace(robot.figures.board, own={"Version": "7"}, odom_hz=20.0))
    robot.seconds(1)
    assert robot.statuses["Board"].values["Version"] == "7"
    assert robot.statuses["Stream"].values["Published odometry (Hz)"] == "20"


HAPPENINGS = [FAULTS[number] for number in (0, 3, 4, 5, 6, 7, 13, 14)]


@pytest.mark.parametrize(("fault", "name", "level", "said"), HAPPENINGS)
def test_what_happened_is_told_for_a_while_and_then_forgotten(
    fault: Change, name: str, level: Level, said: str
) -> None:
    """An event is shown in one status for some time. Then this status is OK again."""
    robot = Robot()
    fault(robot)
    robot.seconds(round(RECENT_S) - 1)
    assert robot.troubles == {name: level}
    robot.seconds(3)
    assert not robot.troubles


def test_a_count_that_begins_anew_has_not_grown() -> None:
    """The port is opened again, and the count of overruns begins at 0. No overrun is reported."""
    robot = Robot()
    robot.connect(overruns=5)
    robot.seconds(round(RECENT_S) + 3)
    robot.connect(overruns=0)
    robot.seconds(1)
    assert not robot.troubles


def test_a_reader_that_waits_for_the_processor_is_said_to_be_late_not_the_line_bad() -> None:
    """A reader that waits for the processor is not reported as a bad line.

    If nothing is lost, the status is OK. If too few readings arrive, the status names the busy
    computer.
    """
    robot = Robot()
    for second in range(12):
        robot.connect(waited_s=0.3 * second)
        robot.seconds(1)
    assert not robot.troubles
    assert "read late: the driver's reader waits 30%" in robot.statuses["Stream"].message
    robot.per_second["imu"] = 60
    for second in range(12, 24):
        robot.connect(waited_s=0.3 * second)
        robot.seconds(1)
    assert robot.troubles["Stream"] is Level.WARN
    assert "too busy: reduce its load" in robot.statuses["Stream"].message


def test_a_skew_that_no_crystal_has_is_told_once_it_has_lasted() -> None:
    """A clock skew that is larger than that of any crystal is reported only after 70 s.

    A busy computer may cause such a skew for a minute.
    """
    robot = Robot()
    robot.set(skew_ppm=-119.0)
    robot.seconds(70)
    assert not robot.troubles
    robot.set(skew_ppm=-20.0)
    robot.seconds(1)
    robot.set(skew_ppm=119.0)
    robot.seconds(70)
    assert not robot.troubles
    robot.seconds(10)
    assert robot.troubles == {"Time": Level.WARN}
    assert "check this computer's clock" in robot.statuses["Time"].message


@pytest.mark.parametrize(
    ("state", "levels"),
    [
        ("imu_only", {"Board": Level.WARN}),
        (
            "paused",
            {"Board": Level.WARN, "Stream": Level.STALE, "Time": Level.STALE, "IMU": Level.STALE},
        ),
        (
            "connecting",
            {"Board": Level.ERROR, "Stream": Level.STALE, "Time": Level.STALE, "IMU": Level.STALE},
        ),
        (
            "disconnected",
            {"Board": Level.STALE, "Stream": Level.STALE, "Time": Level.STALE, "IMU": Level.STALE},
        ),
    ],
)
def test_every_state_of_the_board_has_its_verdicts(state: str, levels: dict[str, Level]) -> None:
    """In each state except nominal, the statuses have the levels that belong to this state.

    Statuses without data have the level "stale". In IMU-only mode, displacements are not expected.
    """
    robot = Robot()
    robot.set(state=state)
    if state == "imu_only":
        robot.per_second.update(displacements=0, poses=0)
    robot.seconds(5)
    assert robot.troubles == levels


def test_a_board_that_has_just_begun_to_send_is_given_time() -> None:
    """When a board has just begun to send data, no rate is reported as too low.

    A rate is computed only from data that came in the board's current state.
    """
    robot = Robot()
    robot.set(state="paused")
    robot.per_second.update(imu=0, displacements=0, poses=0)
    robot.seconds(5)
    robot.set(state="nominal")
    robot.seconds(1)
    assert robot.statuses["Stream"].level is Level.OK
    robot.per_second.update(imu=100, displacements=25, poses=5)
    robot.seconds(1)
    assert not robot.troubles


def test_the_one_who_commands_is_named_with_the_age_of_the_command() -> None:
    """The user commands the robot. The status names the source and the age of the command.

    The status is OK even if commands are limited.
    """
    robot = Robot()
    robot.command(source="cmd_vel", age_s=0.05)
    robot.seconds(1)
    commands = robot.statuses["Commands"]
    assert commands.message == "cmd_vel is in control"
    assert (commands.values["Source"], commands.values["Age (s)"]) == ("cmd_vel", "0.05")
    robot.command(source="cmd_vel", age_s=0.05, limited=3)
    robot.seconds(1)
    commands = robot.statuses["Commands"]
    assert commands.level is Level.OK
    assert "exceeds the limits" in commands.message
    assert commands.values["Limited"] == "3"


def test_what_a_board_does_not_send_has_no_figures() -> None:
    """The board sends no IMU readings and no poses.

    So the diagnostics have no rates of IMU readings and poses, and no status "IMU".
    """
    robot = Robot()
    rates_hz: dict[RateName, float] = {"Odometry": 2.5}
    robot.set(board=BoardFigures(rates_hz=rates_hz))
    robot.count(displacements=0)
    judged = Diagnosis("its power, cable and baudrate").judge(
        robot.link, robot.figures, robot.refusals, robot.now
    )
    assert [status.name for status in judged] == NAMES[:-1]
    stream = next(status.values for status in judged if status.name == "Stream")
    assert {"Odometry rate (Hz)", "Odometry frames lost", "Sequence gaps"} <= set(stream)
    assert not [key for key in stream if "IMU" in key or "Pose" in key]
