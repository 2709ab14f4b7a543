# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of commands that another process sends over real DDS.

The driver obeys or refuses them.
"""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from probe import Probe
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool, Float32MultiArray

from omnibot_driver.shared_session import WAITED
from omnibot_driver.simulator.omnibot import BoardPose, PtyBoard, ReceivedCommand, SimulatedBoard

Start = Callable[..., Any]


@pytest.fixture
def board(shared: tuple[PtyBoard, Driver]) -> PtyBoard:
    return shared[0]


@pytest.fixture
def driver(shared: tuple[PtyBoard, Driver]) -> Driver:
    return shared[1]


@pytest.fixture
def probe(shared_probe: Probe) -> Probe:
    return shared_probe


@contextmanager
def repeated(probe: Probe, publisher: Any, message: object) -> Iterator[None]:
    """Publish a message at 5 Hz while the context lasts.

    The driver logs each kind of refusal at most once in 2 s. So the refusal of a single message may
    be missing in the log.
    """
    timer = probe.node.create_timer(0.2, lambda: publisher.publish(message))
    try:
        yield
    finally:
        probe.remove(timer)


def obeyed(board: SimulatedBoard, kind: str, *values: int) -> bool:
    return any((command.kind, command.values) == (kind, values) for command in board.commands)


def newest(board: SimulatedBoard) -> ReceivedCommand:
    return board.commands[-1]


def test_cmd_vel_reaches_the_board_as_the_manuals_frame(probe: Probe, board: PtyBoard) -> None:
    """A user commands 0.3 m/s, -0.2 m/s and 0.5 rad/s. The board receives 21, -14 and 250 LSB.

    After the timeout it receives Stop.
    """
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x, twist.linear.y, twist.angular.z = 0.3, -0.2, 0.5
    commands.publish(twist)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 21, -14, 250), PATIENCE_S)
    assert board.wait_for(
        lambda b: newest(b) == ReceivedCommand(newest(b).tick, "wheels"), PATIENCE_S
    )


HELD_UP = """
import os, time
import omnibot_driver.node
def hold_up(_driver, message):
    print("the executor is held up", flush=True)
    while os.path.exists({path!r}):
        time.sleep(0.05)
omnibot_driver.node.OmniBotDriver._on_estop_topic = hold_up
"""


@pytest.mark.parametrize(
    ("control", "topics"), [("velocity", ["cmd_vel", "wheel_cmd"]), ("position", ["cmd_pose"])]
)
def test_a_command_that_waited_for_an_executor_that_was_held_up_is_refused(
    start_board: Start,
    start_driver: Start,
    probe_of: Start,
    tmp_path: Path,
    control: str,
    topics: list[str],
) -> None:
    """A command waits for 2 s, because the driver's executor is blocked. The driver refuses it.

    The driver also refuses a goal that waited. The stamp in a goal does not matter.
    """
    hold = tmp_path / "hold"
    board: PtyBoard = start_board(control=control, running=True)
    driver: Driver = start_driver(
        board.path, control_method=control, before=HELD_UP.format(path=str(hold))
    )
    probe: Probe = probe_of(driver)
    odometry = probe.listen(Odometry, "odom")
    probe.wait_for_state("nominal")
    probe.wait_for(lambda: len(odometry) > 10)
    estop = probe.publisher(Bool, "estop")

    def moved(board: SimulatedBoard) -> bool:
        return any(any(command.values) for command in board.commands)

    for topic in topics:
        message: Any = Float32MultiArray(data=[10.0, 0.0, 0.0])
        if topic == "cmd_vel":
            message = Twist()
            message.linear.x = 0.3
        elif topic == "cmd_pose":
            message = PoseStamped()
            message.header.stamp = probe.node.get_clock().now().to_msg()
            message.pose.position.x, message.pose.orientation.w = 0.25, 1.0
        commands = probe.publisher(type(message), topic)
        driver.answers.clear()  # the probe does not publish it again
        for _ in range(10):  # a stall of the computer is another reason for a refusal
            said = len(driver.lines)
            hold.touch()
            estop.publish(Bool(data=True))
            driver.wait_for_line("the executor is held up", said)
            commands.publish(message)
            old = board.board.tick + 200
            assert board.wait_for(lambda b, old=old: b.tick > old, PATIENCE_S)
            hold.unlink()
            refusal = driver.wait_for_line("refused: ", said)
            if WAITED not in refusal:
                break
        assert re.search(f"{topic} refused: it was sent .* s ago.*in this driver's queue", refusal)
        with board.lock:
            assert not moved(board.board)
        assert board.wait_for(
            lambda b, its=commands, same=message: its.publish(same) or moved(b), PATIENCE_S
        )
        if topic != topics[-1]:
            assert board.wait_for(lambda b: not any(newest(b).values), PATIENCE_S)
            with board.lock:
                board.board.commands.clear()


def test_a_zero_twist_is_the_stop_frame(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A zero Twist arrives while the robot drives. The driver sends the Stop frame at once.

    It never sends a velocity frame with zeros.
    """
    board: PtyBoard = start_board()
    probe: Probe = probe_of(start_driver(board.path, cmd_vel_timeout=10.0))
    probe.wait_for_state("nominal")
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    commands.publish(twist)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 21, 0, 0), PATIENCE_S)
    commands.publish(Twist())
    assert board.wait_for(lambda b: newest(b).kind == "wheels", 9.0)
    with board.lock:
        assert not obeyed(board.board, "velocity", 0, 0, 0)


def test_wheel_cmd_turns_the_wheels(probe: Probe, board: PtyBoard) -> None:
    """A user commands wheel rates of 10, -10 and 0 rad/s. The wheels have a radius of 29 mm.

    The driver sends 20, -20 and 0 LSB.
    """
    commands = probe.publisher(Float32MultiArray, "wheel_cmd")
    commands.publish(Float32MultiArray(data=[10.0, -10.0, 0.0]))
    assert board.wait_for(lambda b: obeyed(b, "wheels", 20, -20, 0), PATIENCE_S)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ([1.0, 2.0], "2 values"),
        ([1.0, 2.0, 3.0, 4.0], "4 values"),
        ([1.0, math.nan, 3.0], "NaN or infinity"),
    ],
)
def test_a_wrong_wheel_cmd_is_refused_with_a_reason(
    probe: Probe, driver: Driver, board: PtyBoard, data: list[float], reason: str
) -> None:
    """A wheel_cmd with a wrong number of values, NaN or infinity is rejected with a reason.

    The next correct one is obeyed.
    """
    commands = probe.publisher(Float32MultiArray, "wheel_cmd")
    with repeated(probe, commands, Float32MultiArray(data=data)):
        driver.wait_for_line(f"wheel_cmd rejected.*{reason}")
    commands.publish(Float32MultiArray(data=[10.0, 0.0, 0.0]))
    assert board.wait_for(lambda b: obeyed(b, "wheels", 20, 0, 0), PATIENCE_S)


@pytest.mark.parametrize(("axis", "bad"), [("x", math.nan), ("z", math.inf)])
def test_a_twist_that_is_not_finite_anywhere_is_refused(
    probe: Probe, driver: Driver, board: PtyBoard, axis: str, bad: float
) -> None:
    """A Twist is rejected if any axis has NaN or infinity, even an axis that the driver ignores."""
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.y = 0.3
    setattr(twist.linear, axis, bad)
    with repeated(probe, commands, twist):
        driver.wait_for_line("cmd_vel rejected.*NaN or infinity")
    with board.lock:
        assert not any(command.kind == "velocity" for command in board.board.commands)


def test_a_huge_twist_is_limited_in_its_own_direction(probe: Probe, board: PtyBoard) -> None:
    """A user commands 1e300 m/s to the front left.

    The driver limits the speed, and keeps the direction.
    """
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = twist.linear.y = 1e300
    commands.publish(twist)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 25, 25, 0), PATIENCE_S)


def test_the_estop_topic_latches_and_never_releases(probe: Probe, board: PtyBoard) -> None:
    """A button publishes true on ``estop``, and then false. The e-stop stays latched.

    Only the service can release it.
    """
    active = probe.listen(Bool, "omnibot_driver/estop_active", latched=True)
    button = probe.publisher(Bool, "estop")
    button.publish(Bool(data=True))
    assert board.wait_for(lambda b: "estop" in [c.kind for c in list(b.commands)[-2:]], PATIENCE_S)
    probe.wait_for(lambda: active and active[-1].data)
    button.publish(Bool(data=False))
    with board.lock:
        count = len(board.board.commands)
    assert board.wait_for(lambda b: len(b.commands) > count + 10, PATIENCE_S)
    with board.lock:
        later = list(board.board.commands)[count + 1 :]
    assert {command.kind for command in later} == {"estop", "wheels"}
    assert not any(any(command.values) for command in later)


def test_stamped_commands_are_taken_instead_when_the_parameter_says_so(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """With ``enable_stamped_cmd_vel`` the type of cmd_vel is geometry_msgs/TwistStamped."""
    board: PtyBoard = start_board()
    stamps = {"enable_stamped_cmd_vel": True, "cmd_vel_timeout": 10.0}
    probe: Probe = probe_of(start_driver(board.path, **stamps))
    probe.wait_for_state("nominal")
    commands = probe.publisher(TwistStamped, "cmd_vel")
    stamped = TwistStamped()
    stamped.twist.linear.x = 0.3
    stamped.header.stamp = probe.node.get_clock().now().to_msg()
    commands.publish(stamped)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 21, 0, 0), PATIENCE_S)


def test_a_stale_stamped_command_is_refused_with_its_age_and_an_unstamped_one_is_taken(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A stamped command is older than ``cmd_vel_timeout``. The driver refuses it.

    A command whose stamp is zero is obeyed, because zero is not a time.
    """
    board: PtyBoard = start_board()
    driver: Driver = start_driver(board.path, enable_stamped_cmd_vel=True)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    commands = probe.publisher(TwistStamped, "cmd_vel")
    stamped = TwistStamped()
    stamped.twist.linear.x = 0.3
    stamped.header.stamp = (probe.node.get_clock().now() - Duration(seconds=600)).to_msg()
    commands.publish(stamped)
    driver.wait_for_line(r"cmd_vel refused: it is 6\d\d\.\d\d s old")
    with board.lock:
        assert not any(command.kind == "velocity" for command in board.board.commands)
    stamped = TwistStamped()
    stamped.twist.linear.x = 0.3
    commands.publish(stamped)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 21, 0, 0), PATIENCE_S)


def test_who_publishes_the_other_type_is_named_once(probe: Probe, driver: Driver) -> None:
    """A node publishes cmd_vel with the wrong message type. The driver warns of it once.

    The middleware drops such commands without a report.
    """
    reports = probe.listen(DiagnosticArray, "/diagnostics")
    probe.node.create_publisher(TwistStamped, "cmd_vel", 1)
    driver.wait_for_line(
        "probe publishes cmd_vel with a type other than .*enable_stamped_cmd_vel:=true"
    )
    until = len(reports) + 4  # one report a second; the driver checks every 2 s
    probe.wait_for(lambda: len(reports) >= until)
    assert driver.output.count("publishes cmd_vel with a type other than") == 1


def test_a_publisher_whose_quality_of_service_does_not_fit_is_told(
    probe: Probe, driver: Driver
) -> None:
    """A node publishes cmd_vel best-effort, so the driver cannot receive it.

    The driver warns of this.
    """
    quality = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    probe.node.create_publisher(Twist, "cmd_vel", quality)
    driver.wait_for_line("incompatible QoS.*RELIABILITY")


def test_a_goal_is_driven_to_with_the_switch_on_position_and_velocities_are_refused(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """The board is on positional control. The robot drives to a goal 0.25 m ahead in odom.

    The driver converts the goal to the board's frame. Velocity commands are refused.
    """
    board = start_board(
        control="position", running=True, initial_pose=BoardPose(1000.0, 2000.0, 1570.8)
    )
    driver: Driver = start_driver(board.path, control_method="position")
    probe: Probe = probe_of(driver)
    odometry = probe.listen(Odometry, "odom")
    probe.wait_for_state("nominal")
    probe.wait_for(lambda: len(odometry) > 10)
    goal = PoseStamped()
    goal.header.frame_id = "odom"
    goal.pose.position.x = 0.25
    goal.pose.orientation.w = 1.0
    goals = probe.publisher(PoseStamped, "cmd_pose")

    def arrives() -> bool:
        goals.publish(goal)  # a stall of the computer stops the robot
        return odometry[-1].pose.pose.position.x == pytest.approx(0.25, abs=0.005)

    probe.wait_for(arrives)
    with board.lock:
        assert any(command.kind == "pose" for command in board.board.commands)
    assert odometry[-1].pose.pose.position.y == pytest.approx(0.0, abs=0.005)
    probe.publisher(Twist, "cmd_vel").publish(Twist())
    driver.wait_for_line("cmd_vel refused.*control_method.*position")
    goal.header.frame_id = "map"
    goals.publish(goal)
    driver.wait_for_line("cmd_pose rejected.*'map'.*transform it")
