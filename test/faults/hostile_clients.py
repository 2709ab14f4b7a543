# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Misuse of the driver by people and programs while a commander drives."""

import os
import signal
from collections.abc import Callable
from itertools import chain
from typing import Final

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rig import TIMEOUT_S, Rig
from std_msgs.msg import Bool, Float32MultiArray
from std_srvs.srv import SetBool, Trigger

NONSENSE: Final = (float("nan"), float("inf"), -1.0, 1e12)


def two_commanders(rig: Rig) -> None:
    """Let one commander send velocities while another commander sends wheel rates.

    When both commanders end, the robot must stop.
    """
    publisher = rig.probe.publisher(Float32MultiArray, "wheel_cmd")
    rig.drive()
    for _ in range(40):
        publisher.publish(Float32MultiArray(data=[5.0] * rig.kind.wheels))
        rig.wait_ticks(3)
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "two commanders cease")
    rig.probe.remove(publisher)


def other_type(rig: Rig) -> None:
    """Publish TwistStamped on cmd_vel, whose type is Twist.

    The messages must have no effect, and the driver must report the wrong type.
    """
    context = rclpy.Context()
    context.init()
    node = Node("other", namespace=rig.driver.namespace, context=context)
    publisher = node.create_publisher(TwistStamped, "cmd_vel", 1)
    stamped = TwistStamped()
    stamped.twist.linear.x = 0.3
    rig.drive()
    rig.hand.leave()
    since = rig.line.tick
    for _ in range(30):
        publisher.publish(stamped)
        rig.wait_ticks(5)
    rig.expect_still(since, "TwistStamped messages on cmd_vel continue")
    rig.driver.wait_for_line("TwistStamped")
    node.destroy_node()
    context.shutdown()


def flood_of_releases(rig: Rig) -> None:
    """Publish ``false`` on ``estop`` 1000 times a second.

    Only the service may release the e-stop.
    """
    publisher = rig.probe.publisher(Bool, "estop")
    rig.drive()
    rig.probe.call(SetBool, "estop", data=True)
    rig.probe.wait_for(lambda: rig.estops[-1].data)
    since = rig.line.tick
    for _ in range(100):
        for _ in range(10):
            publisher.publish(Bool(data=False))
        rig.wait_ticks(1)
    rig.expect_still(since, "e-stop while commands and releases by topic continue", 0.0)
    rig.findings.expect(rig.estops[-1].data, "the e-stop was released")
    rig.hand.leave()
    rig.probe.call(SetBool, "estop", data=False)
    rig.probe.remove(publisher)


def everybody_calls_at_once(rig: Rig) -> None:
    """Call every service five times while the driver reconnects to the board.

    The driver must answer each call. No call may move the robot.
    """
    rig.drive()
    rig.hand.leave()
    rig.unplug()
    rig.probe.wait_for_state("disconnected")
    calls = [
        *((Trigger, name, {}) for name in ("start", "reset", "reset_odometry")),
        *((SetBool, name, {"data": data}) for name in ("pause", "estop") for data in (True, False)),
    ]
    clients = [
        (rig.probe.client(kind, name), kind.Request(**data))
        for kind, name, data in calls
        if name in rig.kind.services
    ]
    rig.plug()
    since = rig.line.tick
    rounds = []
    for _ in range(5):
        rounds.append([client.call_async(request) for client, request in clients])
        rig.wait_ticks(30)
    for future in chain(*rounds):
        rig.probe.wait_for_future(future)
    rig.expect_still(since, "everybody calls", 1.0)
    rig.probe.call(SetBool, "estop", data=False)
    if "start" in rig.kind.services:
        rig.probe.call(Trigger, "start")


def nonsense_for_parameters(rig: Rig) -> None:
    """Set every limit and timeout to invalid values. The driver must refuse all of them."""
    rig.drive()
    parameters = [
        Parameter(
            name=name,
            value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value),
        )
        for name in rig.kind.tuning
        for value in NONSENSE
    ]
    answer = rig.probe.call(SetParameters, "set_parameters", parameters=parameters)
    taken = [
        one.name
        for one, result in zip(parameters, answer.results, strict=True)
        if result.successful
    ]
    rig.findings.expect(not taken, f"invalid values were accepted for {taken}")
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "after nonsense for parameters")


def limit_lowered(rig: Rig) -> None:
    """Lower the speed limit to zero while commands continue.

    The robot must be at rest when the service answers.
    """

    def limit(mps: float) -> None:
        one = Parameter(name="max_linear_speed")
        one.value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=mps)
        answer = rig.probe.call(SetParameters, "set_parameters", parameters=[one])
        rig.findings.expect(answer.results[0].successful, "a limit was refused")

    rig.drive(yaw_rate=0.0)
    limit(0.0)
    rig.expect_still(rig.line.tick, "the limit is nothing", allowed_s=0.0)
    rig.hand.leave()
    limit(0.5)


def flood_into_a_full_port(rig: Rig) -> None:
    """Send 1000 commands a second while the port is full.

    When the port accepts data again, the old commands must not drive the robot.
    """
    publisher = rig.probe.publisher(Twist, "cmd_vel")
    fast = Twist()
    fast.linear.x = 0.4
    rig.drive()
    rig.hand.leave()
    with rig.terminal.kept_full(rig.kind.old_command):
        for _ in range(200):
            for _ in range(10):
                publisher.publish(fast)
            rig.wait_ticks(1)
    rig.probe.wait_for_state("nominal")
    rig.expect_still(rig.line.tick, "a flood into a full port ends", TIMEOUT_S)
    rig.probe.remove(publisher)


def guard_killed(rig: Rig) -> None:
    """Kill the guard process. The driver must start another guard and continue to drive."""
    rig.drive()
    (first,) = rig.driver.guards()
    os.kill(first, signal.SIGKILL)
    assert rig.wait_for_board(lambda _: rig.driver.guards() not in ([], [first])), "no new guard"
    assert rig.wait_for_board(lambda line: line.board.driven), "the robot was stopped"
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "with a new guard")


UNKIND: Final[dict[str, Callable[[Rig], None]]] = {
    "two commanders in turn": two_commanders,
    "TwistStamped where Twist is expected": other_type,
    "1,000 releases a second by topic": flood_of_releases,
    "five clients call everything during a reconnection": everybody_calls_at_once,
    "limits and timeouts of NaN, infinity, -1": nonsense_for_parameters,
    "max_linear_speed is set to 0": limit_lowered,
    "1,000 commands a second into a full port": flood_into_a_full_port,
    "the guard is killed": guard_killed,
}
