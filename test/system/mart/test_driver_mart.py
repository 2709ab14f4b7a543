# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver with a simulated MART controller, on real UDP sockets."""

import math
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
from batches import InBatches
from driver_process import Driver
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from probe import Probe
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.duration import Duration
from sensor_msgs.msg import BatteryState, Range
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.files import CHECK_FOLDER
from omnibot_driver.simulator.common.serving import ServedBoard
from omnibot_driver.simulator.mart import MartSettings, SimulatedMart

Start = Callable[..., Any]
PATIENCE_S: Final = 30.0
SECOND_TICKS: Final = 500
STANDS_TICKS: Final = 400
"""Numbers of the controller's ticks: ``SECOND_TICKS`` in 1 s, ``STANDS_TICKS`` in 0.8 s."""
MOTIONS: Final = {
    "RM": (0.3, 0.2),
    "B": (-0.2, 0.0),
    "L": (0.0, 0.5),
}


class Served(InBatches[SimulatedMart], ServedBoard[SimulatedMart]):
    """A simulated MART controller on its UDP ports."""


class Mart:
    """A simulated MART controller that runs in real time."""

    def __init__(self, served: "ServedBoard[SimulatedMart]") -> None:
        self.served = served

    @property
    def url(self) -> str:
        return self.served.addresses[0]

    def wait_for(self, predicate: Callable[[SimulatedMart], object]) -> None:
        found = self.served.wait_for(lambda board: bool(predicate(board)), PATIENCE_S)
        assert found, list(self.served.board.server.executed)[-20:]

    def do(self, action: Callable[[SimulatedMart], Any]) -> Any:
        with self.served.lock:
            return action(self.served.board)

    def stands_for_good(self) -> None:
        since: list[int] = []

        def stood(board: SimulatedMart) -> bool:
            if board.server.moving:
                since.clear()
                return False
            since.append(board.ticks)
            return since[-1] - since[0] >= STANDS_TICKS

        self.wait_for(stood)
        assert not self.do(lambda board: board.server.hung)

    def answer_at_rest(self, probe: Probe, service: str) -> Any:
        """Call the service until the driver knows that the robot is at rest; return the answer."""
        return self.answer(probe, service, while_refused="the robot may still be moving")

    def answer(self, probe: Probe, service: str, while_refused: str = "refused") -> Any:
        """Call the service once a second, as long as its answer contains ``while_refused``.

        Return the last answer.
        """
        for _ in range(round(PATIENCE_S)):
            done = probe.call(Trigger, service)
            if while_refused not in done.message:
                break
            later = self.do(lambda board: board.ticks) + SECOND_TICKS
            self.wait_for(lambda board, later=later: board.ticks > later)
        return done


def mart_of(stack: ExitStack) -> Mart:
    return Mart(stack.enter_context(Served(SimulatedMart(MartSettings(dock_m=5.0)))))


@pytest.fixture(scope="module")
def mart(_ros: None) -> Iterator[Mart]:
    """The controller that all tests use, except those that use ``new``."""
    with ExitStack() as stack:
        yield mart_of(stack)


@pytest.fixture(scope="module")
def driver(mart: Mart) -> Iterator[Driver]:
    with Driver(port=mart.url, board="mart") as driver:
        yield driver


def goal_at(x_m: float) -> PoseStamped:
    goal = PoseStamped()
    goal.header.frame_id = "odom"
    goal.pose.orientation.w = 1.0
    goal.pose.position.x = x_m
    return goal


New = tuple[Mart, Driver, Probe]


@pytest.fixture
def new(stack: ExitStack, start_driver: Start, probe_of: Start, tmp_path: Path) -> New:
    """A controller, its driver and a probe that no other test uses."""
    mart = mart_of(stack)
    driver: Driver = start_driver(mart.url, board="mart", record_directory=str(tmp_path))
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    return mart, driver, probe


@contextmanager
def driven(probe: Probe, mart: Mart, vx: float, yaw_rate: float) -> Iterator[None]:
    """Command a velocity at 10 Hz until the context ends.

    The context begins when the robot moves.
    """
    with probe.commanding(vx, yaw_rate):
        mart.wait_for(lambda board: board.server.chassis.moving)
        yield


def test_it_drives_and_odometry_tells_how_far(mart: Mart, probe: Probe) -> None:
    """The robot drives 0.5 m and stops when the commands end.

    The pose in odom is right within 1 cm.
    """
    odometry = probe.listen(Odometry, "odom")
    probe.wait_for_state("nominal")
    batteries = probe.listen(BatteryState, "battery_state")
    ranges = probe.listen(Range, "range/front")
    docked = probe.listen(Bool, "docked", latched=True)
    with driven(probe, mart, 0.3, 0.0):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.5)
    mart.stands_for_good()
    x_m = mart.do(lambda board: board.server.chassis.x_m)
    probe.wait_for(lambda: abs(odometry[-1].pose.pose.position.x - x_m) < 0.01)
    probe.wait_for(lambda: batteries and ranges and docked)
    assert batteries[-1].voltage == pytest.approx(24.0, abs=0.05)
    assert math.isinf(ranges[-1].range)
    assert ranges[-1].header.frame_id == "range_front_link"
    assert not docked[-1].data


def test_a_download_that_cannot_be_saved_ends_with_the_reason(
    stack: ExitStack, start_driver: Start, probe_of: Start
) -> None:
    """The folder for downloads is in the home directory of an unknown user.

    A download fails. The answer has the reason and the remedy, and the driver continues.
    """
    mart, folder = mart_of(stack), "~nobody_of_this_name/records"
    probe: Probe = probe_of(start_driver(mart.url, board="mart", record_directory=folder))
    probe.wait_for_state("nominal")
    for _ in range(2):
        with driven(probe, mart, 0.3, 0.0):
            pass
        mart.stands_for_good()
        answer = probe.call(Trigger, "download_last_move")
        assert not answer.success
        assert "not saved" in answer.message, answer.message
        assert CHECK_FOLDER in answer.message, answer.message


def test_the_estop_stops_each_motion(mart: Mart, probe: Probe) -> None:
    """The e-stop ends each kind of motion by the stop command for that kind.

    The MART server still answers afterwards.
    """
    for motion in MOTIONS.values():
        with driven(probe, mart, *motion):
            assert probe.call(SetBool, "estop", data=True).success
            mart.stands_for_good()
        assert probe.call(SetBool, "estop", data=False).success


@pytest.mark.parametrize(
    ("motion", "number"), [("RM", signal.SIGINT), ("RM", signal.SIGKILL), ("L", signal.SIGKILL)]
)
def test_whatever_ends_the_driver_stops_each_motion(
    new: New, motion: str, number: signal.Signals
) -> None:
    """A signal ends the driver during a motion.

    The driver or its guard process sends the stop command for this motion.
    """
    mart, driver, probe = new
    with driven(probe, mart, *MOTIONS[motion]):
        driver.process.send_signal(number)
        mart.stands_for_good()


@pytest.mark.parametrize("word", ["RM ", "TF"])
def test_a_driver_that_is_killed_before_the_reply_leaves_the_robot_standing(
    new: New, word: str
) -> None:
    """The driver sends a velocity or a controlled move, and is killed before the server replies.

    The driver's guard process stops the robot.
    """
    mart, driver, probe = new
    if word == "TF":
        probe.publisher(PoseStamped, "cmd_pose").publish(goal_at(2.0))
    else:
        vx, yaw_rate = MOTIONS[word.strip()]
        publisher = probe.publisher(Twist, "cmd_vel")
        twist = Twist()
        twist.linear.x, twist.angular.z = vx, yaw_rate
        probe.node.create_timer(0.1, lambda: publisher.publish(twist))
    mart.wait_for(lambda board: board.server.executed[-1].startswith(word))
    driver.process.send_signal(signal.SIGKILL)
    mart.stands_for_good()


def test_a_zero_with_an_old_stamp_ends_a_goal(
    stack: ExitStack, start_driver: Start, probe_of: Start
) -> None:
    """The robot drives to a goal. Then a zero TwistStamped arrives, whose stamp is 600 s old.

    The driver refuses the command, but discards the goal and stops the robot.
    """
    mart = mart_of(stack)
    driver: Driver = start_driver(mart.url, board="mart", enable_stamped_cmd_vel=True)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    zeros = probe.publisher(TwistStamped, "cmd_vel")
    probe.publisher(PoseStamped, "cmd_pose").publish(goal_at(2.0))
    mart.wait_for(lambda board: board.server.chassis.moving)
    zero = TwistStamped()
    zero.header.stamp = (probe.node.get_clock().now() - Duration(seconds=600)).to_msg()
    zeros.publish(zero)
    driver.wait_for_line("goal of cmd_pose is discarded: cmd_vel commanded")
    mart.stands_for_good()


def test_a_zero_with_an_old_stamp_ends_a_docking(
    stack: ExitStack, start_driver: Start, probe_of: Start
) -> None:
    """The robot drives to the dock. Then a zero TwistStamped arrives, whose stamp is 600 s old.

    The driver refuses the command, but stops the robot. ``~/dock`` fails.
    """
    mart = mart_of(stack)
    driver: Driver = start_driver(
        mart.url, board="mart", enable_stamped_cmd_vel=True, dock_distance=3.0
    )
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    zeros = probe.publisher(TwistStamped, "cmd_vel")
    assert mart.answer(probe, "calibrate_gyro").success  # so the robot is known to be at rest
    docking = probe.call_async(Trigger, "dock")
    mart.wait_for(lambda board: board.server.chassis.moving)
    zero = TwistStamped()
    zero.header.stamp = (probe.node.get_clock().now() - Duration(seconds=600)).to_msg()
    zeros.publish(zero)
    driver.wait_for_line("the docking is cancelled: cmd_vel commanded")
    assert not docking.wait().success
    mart.stands_for_good()


def test_a_robot_that_the_motion_monitor_has_stopped_does_not_dock(
    stack: ExitStack, start_driver: Start, probe_of: Start
) -> None:
    """The motion monitor stops the robot twice, because ``encoder_inverted`` is wrong.

    The driver then refuses motion until the e-stop is latched and released. So it refuses to dock.
    """
    mart = mart_of(stack)
    driver: Driver = start_driver(mart.url, board="mart", encoder_inverted=True)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    for stop in ("until you send a zero command", "until the e-stop is latched and released"):
        with driven(probe, mart, 0.3, 0.0):
            driver.wait_for_line(f"wrong direction.*{stop}")
        mart.stands_for_good()
    done = mart.answer_at_rest(probe, "dock")
    assert not done.success
    assert "the motion monitor has stopped the robot twice" in done.message
    assert not mart.do(lambda board: board.server.moving)


def test_a_driver_that_hangs_is_guarded(new: New) -> None:
    """The driver is suspended during a drive. Its guard process stops the robot after 0.5 s."""
    mart, driver, probe = new
    with driven(probe, mart, 0.3, 0.0):
        driver.process.send_signal(signal.SIGSTOP)
        mart.stands_for_good()
    driver.process.send_signal(signal.SIGCONT)
    mart.stands_for_good()


def test_its_services_answer(new: New, tmp_path: Path) -> None:
    """The services calibrate the gyro, start the log, and download the last move and the log.

    An existing file of the same name is kept. The download of the log ends the MART server.
    """
    mart, _driver, probe = new
    with driven(probe, mart, 0.3, 0.0):
        pass
    mart.stands_for_good()
    done = mart.answer(probe, "calibrate_gyro")
    assert done.success, done.message
    done = mart.answer(probe, "download_last_move")
    assert done.success, done.message
    assert Path(done.message).parent == tmp_path
    assert Path(done.message).read_text(encoding="utf-8")
    again = mart.answer(probe, "download_last_move")
    assert Path(again.message).name == f"{Path(done.message).stem}-2.csv"
    assert not probe.call(Trigger, "download_log").success
    assert mart.answer(probe, "start_log").success
    done = mart.answer(probe, "download_log")
    assert done.success, done.message
    assert "must be started again" in done.message
    assert mart.do(lambda board: board.server.crashed) == "EXIT"


def test_ranges_and_docking_follow_parameters_that_change_while_it_runs(
    mart: Mart, probe: Probe
) -> None:
    """New values of ``range_maximum`` and ``dock_distance`` take effect while the driver runs.

    For a ``dock_distance`` of 0.1 m (3.9 inches), the driver requests 2 inches, because the robot
    may drive 1.6 times as far as requested.
    """
    ranges = probe.listen(Range, "range/front")
    whole = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=4)
    real = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=0.1)
    changes = [
        Parameter(name="range_maximum", value=whole),
        Parameter(name="dock_distance", value=real),
    ]
    results = probe.call(SetParameters, "set_parameters", parameters=changes).results
    assert all(result.successful for result in results)
    probe.wait_for(lambda: ranges and ranges[-1].max_range == 4.0)
    mart.stands_for_good()
    assert mart.answer(probe, "dock").success
    assert "TF DOCK 2" in mart.do(lambda board: list(board.server.executed))


def test_a_distance_beyond_the_maximum_is_published_as_infinite(new: New) -> None:
    """A wall is 5 m away. The user sets ``range_maximum`` to 4 m. The driver publishes infinity."""
    mart, _, probe = new
    ranges = probe.listen(Range, "range/front")
    mart.do(lambda board: setattr(board.server, "front_m", 5.0))
    probe.wait_for(lambda: ranges and ranges[-1].range == pytest.approx(5.0, abs=0.05))
    real = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=4.0)
    changes = [Parameter(name="range_maximum", value=real)]
    assert probe.call(SetParameters, "set_parameters", parameters=changes).results[0].successful
    probe.wait_for(lambda: ranges[-1].max_range == 4.0)
    assert ranges[-1].range == math.inf


def test_a_server_that_does_not_answer_is_told(start_driver: Start) -> None:
    """The server at the board's address does not answer.

    The driver reports that no data arrives.
    """
    driver = start_driver("udp://127.0.0.1:9", board="mart")
    driver.wait_for_line("no data from the board")
