# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver with a LOIS ECU on a real pseudo-terminal, as documented and as its firmware is."""

import math
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import Imu, JointState, NavSatFix, NavSatStatus, TimeReference
from std_msgs.msg import Bool, Float32MultiArray, String
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.simulator.common.serving import PtyBoard
from omnibot_driver.simulator.lois_ecu import QUIRKS, LoisSettings, SimulatedLois
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.robot import connect
from omnibot_driver.tools.calibrate.tick_records import read
from omnibot_driver.tools.needs import ToolError

Start = Callable[..., Any]
PATIENCE_S: Final = 30.0
NODE: Final = "omnibot_driver"
GAINS: Final = {
    "low_pass": 0.1,
    "left_feed_forward": 2.0,
    "left_kp": 0.629402,
    "left_tn": 0.301907,
    "left_td": 0.611789,
    "right_feed_forward": 2.0,
    "right_kp": 0.470583,
    "right_tn": 0.232542,
    "right_td": 0.60868,
}
"""Of docs/boards/lois_ecu.md: with them no wheel swings."""


class Ecu:
    """A simulated board in real time."""

    def __init__(self, firmware: Any, served: "PtyBoard[SimulatedLois]") -> None:
        self.firmware, self.served = firmware, served

    @property
    def path(self) -> str:
        return self.served.path

    def wait_for(self, predicate: Callable[[SimulatedLois], object]) -> None:
        assert self.served.wait_for(lambda board: bool(predicate(board)), PATIENCE_S), list(
            self.served.board.commands
        )[-20:]

    def do(self, action: Callable[[SimulatedLois], object]) -> Any:
        with self.served.lock:
            return action(self.served.board)

    def stands_for_good(self) -> None:
        """For a second and a half."""
        since: list[int] = []

        def stood(board: SimulatedLois) -> bool:
            if not board.standing:
                since.clear()
                return False
            since.append(board.tick)
            return since[-1] - since[0] >= 150

        self.wait_for(stood)


def ecu_of(firmware: Any, stack: ExitStack, **settings: Any) -> Ecu:
    board = SimulatedLois(LoisSettings(quirks=QUIRKS[firmware], **settings))
    return Ecu(firmware, stack.enter_context(PtyBoard(board)))


@pytest.fixture(params=QUIRKS)
def ecu(request: pytest.FixtureRequest, stack: ExitStack) -> Ecu:
    return ecu_of(request.param, stack)


@pytest.fixture
def driver(ecu: Ecu, start_driver: Start) -> Driver:
    started: Driver = start_driver(ecu.path, board="lois_ecu")
    return started


@pytest.fixture
def probe(driver: Driver, probe_of: Start) -> Probe:
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    return probe


@contextmanager
def driven(probe: Probe, ecu: Ecu, vx: float = 0.3, yaw: float = 0.0) -> Iterator[None]:
    """Commanded ten times a second; begins when it moves."""
    publisher = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x, twist.angular.z = vx, yaw
    timer = probe.node.create_timer(0.1, lambda: publisher.publish(twist))
    try:
        ecu.wait_for(lambda board: not board.standing)
        yield
    finally:
        probe.remove(timer)


def test_it_drives_and_odometry_tells_how_far(
    ecu: Ecu, start_driver: Start, probe_of: Start
) -> None:
    """A metre on, within 4 cm; commands that cease stop it. With the gains of the boot it swerves:
    what that does to the odometry is measured in simulated time."""
    probe: Probe = probe_of(start_driver(ecu.path, board="lois_ecu", **GAINS))
    probe.wait_for_state("nominal")
    ecu.wait_for(lambda board: board.wheels[1].controller.gains.kp == pytest.approx(0.470583))
    odometry = probe.listen(Odometry, "odom")
    joints = probe.listen(JointState, "joint_states")
    with driven(probe, ecu):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 1.0)
    ecu.stands_for_good()
    truth = ecu.do(lambda board: board.truth)
    seen = len(odometry)
    probe.wait_for(lambda: len(odometry) > seen + 10)
    place = odometry[-1].pose.pose.position
    assert math.hypot(place.x - truth.x_m, place.y - truth.y_m) < 0.04
    assert joints[-1].name == ["left_wheel_joint", "right_wheel_joint"]
    ticks = ecu.do(lambda board: [wheel.ticks for wheel in board.wheels])
    rolled_m = [ticks_of_wheel * math.tau * 0.13 / 60 for ticks_of_wheel in ticks]
    assert [angle * 0.13 for angle in joints[-1].position] == pytest.approx(rolled_m, abs=0.06)
    assert 0.0 < odometry[-1].pose.covariance[0] < 0.05
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in odometry]
    assert all(after > before for before, after in pairwise(stamps))


def test_the_estop_stops_it_until_it_is_released(ecu: Ecu, probe: Probe) -> None:
    """Although commands go on."""
    with driven(probe, ecu):
        assert probe.call(SetBool, "estop", data=True).success
        ecu.stands_for_good()
        assert probe.call(SetBool, "estop", data=False).success
        ecu.wait_for(lambda board: not board.standing)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL, signal.SIGSTOP])
def test_whatever_ends_the_driver_stops_it(
    ecu: Ecu, driver: Driver, probe: Probe, number: signal.Signals
) -> None:
    """Its own exit, or the guard."""
    with driven(probe, ecu):
        driver.process.send_signal(number)
        ecu.stands_for_good()
    if number is signal.SIGSTOP:
        driver.process.send_signal(signal.SIGCONT)
        ecu.stands_for_good()


def test_the_button_latches_the_drivers_estop_and_its_release_moves_nothing(
    ecu: Ecu, probe: Probe
) -> None:
    """Only the service releases it. Before the first press nothing is said of the button."""
    button = probe.listen(Bool, "estop_button", latched=True)
    latched = probe.listen(Bool, f"{NODE}/estop_active", latched=True)
    with driven(probe, ecu):
        assert not button
        ecu.do(lambda board: board.press(True))
        probe.wait_for(lambda: latched and latched[-1].data)
        probe.wait_for(lambda: button and button[-1].data)
        ecu.stands_for_good()
        ecu.do(lambda board: board.press(False))
        probe.wait_for(lambda: not button[-1].data)
        ecu.stands_for_good()
        assert probe.call(SetBool, "estop", data=False).success
        ecu.wait_for(lambda board: not board.standing)


def test_a_restart_of_the_board_discards_the_command_and_the_settings_come_back(
    ecu: Ecu, probe: Probe
) -> None:
    """It forgets its low-pass; odometry goes on."""
    odometry = probe.listen(Odometry, "odom")
    with driven(probe, ecu):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.4)
    ecu.stands_for_good()
    ecu.do(lambda board: board.reboot())
    ecu.wait_for(lambda board: board.wheels[0].controller.gains.low_pass == 1.0)
    ecu.wait_for(lambda board: board._timers[0x12].period_ms == 200)
    probe.wait_for_state("nominal")
    with driven(probe, ecu):
        probe.wait_for(lambda: odometry[-1].pose.pose.position.x > 0.7)
    ecu.stands_for_good()
    truth = ecu.do(lambda board: board.truth)
    assert odometry[-1].pose.pose.position.x == pytest.approx(truth.x_m, abs=0.08)


def test_reset_is_confirmed_by_the_ticks(ecu: Ecu, probe: Probe) -> None:
    """After it the robot drives again; odometry goes on."""
    odometry = probe.listen(Odometry, "odom")
    with driven(probe, ecu):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.6)
    ecu.stands_for_good()
    answer = probe.call(Trigger, "reset")
    assert answer.success, answer.message
    assert ecu.do(lambda board: [wheel.ticks for wheel in board.wheels]) == [0, 0]
    with driven(probe, ecu):
        probe.wait_for(lambda: odometry[-1].pose.pose.position.x > 0.8)


def test_led_and_ball(ecu: Ecu, probe: Probe) -> None:
    """A ball is asked for once."""
    assert probe.call(SetBool, "led", data=True).success
    ecu.wait_for(lambda board: board.led)
    assert probe.call(SetBool, "led", data=False).success
    ecu.wait_for(lambda board: not board.led)
    assert probe.call(Trigger, "distribute_ball").success
    assert ecu.do(lambda board: board.balls) <= 1


def test_a_gain_is_written_when_it_is_set_and_again_after_a_restart(ecu: Ecu, probe: Probe) -> None:
    """Nothing else is written that the user did not set."""
    client = probe.node.create_client(SetParameters, f"{NODE}/set_parameters")
    assert client.wait_for_service(PATIENCE_S)
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=0.5)
    request = SetParameters.Request(parameters=[Parameter(name="left_kp", value=value)])
    future = client.call_async(request)
    probe.wait_for_future(future)
    assert future.result().results[0].successful
    ecu.wait_for(lambda board: board.wheels[0].controller.gains.kp == pytest.approx(0.5))
    ecu.do(lambda board: board.reboot())
    ecu.wait_for(lambda board: board.wheels[0].controller.gains.kp == pytest.approx(0.5))
    written = {obeyed.command for obeyed in ecu.do(lambda board: list(board.commands))}
    assert written <= {0x01, 0x02, 0x06, 0x0F, 0x11, 0x12, 0x13, 0x20, 0x23}


def test_gps_time_and_heading_are_published_where_the_board_tells_them(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """In ENU: the robot looks east, and magnetic north is ahead by the declination."""
    ecu = ecu_of("documented", stack, running=True)
    driver = start_driver(
        ecu.path, board="lois_ecu", date_period=0.5, time_period=0.5, magnetic_declination=0.1
    )
    probe: Probe = probe_of(driver)
    fixes = probe.listen(NavSatFix, "fix")
    times = probe.listen(TimeReference, "time_reference")
    headings = probe.listen(Imu, "imu/heading")
    probe.wait_for(lambda: fixes and times and headings)
    assert fixes[-1].header.frame_id == "gps_link"
    assert fixes[-1].status.status == NavSatStatus.STATUS_FIX
    assert fixes[-1].latitude == pytest.approx(48.1, abs=1e-4)
    assert fixes[-1].position_covariance[0] >= 0.16
    assert times[-1].time_ref.sec > 946_684_800
    turn = headings[-1].orientation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(-0.1, abs=0.03)
    assert headings[-1].angular_velocity_covariance[0] == -1.0


def test_a_fix_of_the_public_firmware_is_none(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """It sends zeros."""
    probe: Probe = probe_of(start_driver(ecu_of("firmware", stack).path, board="lois_ecu"))
    fixes = probe.listen(NavSatFix, "fix")
    probe.wait_for(lambda: fixes)
    assert fixes[-1].status.status == NavSatStatus.STATUS_NO_FIX


def test_duties_are_commanded_in_duty_mode_alone(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """Limited by max_duty, and they expire like other commands."""
    ecu = ecu_of("firmware", stack)
    driver = start_driver(ecu.path, board="lois_ecu", drive_mode="duty", max_duty=40)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    publisher = probe.publisher(Float32MultiArray, "duty_cmd")
    timer = probe.node.create_timer(
        0.1, lambda: publisher.publish(Float32MultiArray(data=[30.0, 60.0]))
    )
    ecu.wait_for(lambda board: [wheel.duty_percent for wheel in board.wheels] == [20, 40])
    ecu.wait_for(lambda board: not board.standing)
    probe.remove(timer)
    ecu.stands_for_good()


@pytest.mark.parametrize("firmware", QUIRKS)
def test_it_runs_inside_the_driver_too(firmware: str, start_driver: Start, probe_of: Start) -> None:
    """``sim://`` is this board's simulator."""
    driver = start_driver(f"sim://?firmware={firmware}", board="lois_ecu")
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    home = f"/{driver.namespace}"
    probe.wait_for_node(NODE, home)

    def topics() -> set[str]:
        found = probe.node.get_publisher_names_and_types_by_node(NODE, home)
        return {name.removeprefix(f"{home}/") for name, _ in found}

    probe.wait_for_graph(lambda: topics() >= {"odom", "joint_states", "fix", "time_reference"})
    probe.wait_for_graph(lambda: topics() >= {"imu/heading", "estop_button"})
    assert "imu/data_raw" not in topics()
    assert driver.end(signal.SIGINT) == 0


def test_a_terminal_mode_passes_lines_on_and_the_drive_mode_changes_while_it_runs(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """Both are parameters of a driver that runs; what they need is there and goes with them.

    The public firmware passes on both sensors in either mode, and here they speak at once.
    """
    ecu = ecu_of("firmware", stack, running=True)
    probe: Probe = probe_of(start_driver(ecu.path, board="lois_ecu"))
    probe.wait_for_state("nominal")
    lines = probe.listen(String, f"{NODE}/terminal")
    log = probe.listen(Log, "/rosout")
    set_parameter(probe, "terminal_mode", "gps")
    probe.wait_for(lambda: lines and lines[-1].data.startswith("$HCHDT"))
    set_parameter(probe, "terminal_mode", "host")
    probe.wait_for(lambda: any("presses and releases" in line.msg for line in log))
    set_parameter(probe, "drive_mode", "duty")
    publisher = probe.publisher(Float32MultiArray, "duty_cmd")
    timer = probe.node.create_timer(
        0.1, lambda: publisher.publish(Float32MultiArray(data=[30.0, 30.0]))
    )
    ecu.wait_for(lambda board: [wheel.duty_percent for wheel in board.wheels] == [30, 30])
    probe.remove(timer)


def test_a_record_is_a_file_and_an_estop_ends_one(
    start_driver: Start, probe_of: Start, stack: ExitStack, tmp_path: Path
) -> None:
    """The answer is its path; what was not recorded whole leaves nothing."""
    ecu = ecu_of("firmware", stack, running=True)
    folder = tmp_path / "records"
    driver = start_driver(
        ecu.path, board="lois_ecu", record_samples=30, record_directory=str(folder)
    )
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    answer = probe.call(Trigger, "record_heading")
    assert answer.success, answer.message
    assert Path(answer.message).parent == folder
    assert len(Path(answer.message).read_text().splitlines()) == 31
    status = probe.listen(DiagnosticArray, "/diagnostics")
    waiting = probe.call_async(Trigger, "record_rpm")  # for ticks, which do not come
    probe.wait_for(lambda: "record of RPM: " in str(status[-1:]))
    assert "record of RPM is under way" in probe.call(Trigger, "record_torque").message
    assert probe.call(SetBool, "estop", data=True).success
    ended = waiting.wait()
    assert not ended.success
    assert "e-stop" in ended.message
    assert len(list(folder.iterdir())) == 1


def set_parameter(probe: Probe, name: str, value: str) -> None:
    """While it runs."""
    client = probe.node.create_client(SetParameters, f"{NODE}/set_parameters")
    assert client.wait_for_service(PATIENCE_S)
    text = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
    future = client.call_async(SetParameters.Request(parameters=[Parameter(name=name, value=text)]))
    probe.wait_for_future(future)
    assert future.result().results[0].successful, future.result().results[0].reason


def test_a_calibration_records_while_it_drives_and_leaves_the_robot_standing(
    start_driver: Start, stack: ExitStack, tmp_path: Path
) -> None:
    """The file has the ticks of both wheels from their start on; a refusal is passed on as it
    is."""
    ecu = ecu_of("firmware", stack, running=True)
    driver = start_driver(
        ecu.path,
        board="lois_ecu",
        record_samples=40,
        record_directory=str(tmp_path),
        cmd_vel_timeout=3.0,
    )
    driver.wait_for_line("state: nominal")
    with Interruption() as interruption, connect(driver.namespace, [], interruption) as robot:
        path = robot.record("record_rpm", "wheel_cmd", [3.0, 3.0])
        ecu.stands_for_good()
        found = read(path)
        assert [len(found[side]) for side in ("left", "right")] == [40, 40]
        assert robot.parameters["motion_monitor"] is True
        robot.call("estop", on=True)
        with pytest.raises(ToolError, match="e-stop"):
            robot.record("record_rpm", "wheel_cmd", [3.0, 3.0])
