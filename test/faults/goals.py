# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Events that discard a goal of position control.

The robot must then be at rest until the next command. Each event returns the tick from which the
robot must be at rest.
"""

import signal
from collections.abc import Callable
from functools import partial
from typing import Final

from breakable_line import cut
from other_rigs import GoalRig
from rig import TIMEOUT_S
from std_srvs.srv import SetBool, Trigger
from stuck import TAKES_NOTHING

OLD_GOAL: Final = bytes.fromhex("FF FE 01 7F FF 7F FF 00 00")
"""A command to drive to the goal with the largest x and y that a frame can contain."""
UNHEARD_S: Final = 0.3
"""Time in s without data from the board after which the driver no longer drives the robot."""
HANGS_S: Final = 1.0


def cut_from_the_board(rig: GoalRig) -> int:
    since = rig.line.tick
    rig.line.from_board = cut
    rig.wait_ticks(200)
    rig.heal()
    return since


def cut_both_ways(rig: GoalRig) -> int:
    rig.line.from_board = rig.line.to_board = cut
    rig.wait_ticks(300)
    rig.heal()
    return rig.line.tick


def unplugged(rig: GoalRig) -> int:
    rig.unplug()
    rig.probe.wait_for_state("disconnected")
    rig.plug()
    return rig.line.tick


def full_port(rig: GoalRig) -> int:
    mark = len(rig.driver.lines)
    with rig.terminal.full(OLD_GOAL):
        rig.driver.wait_for_line(TAKES_NOTHING, mark)
    return rig.line.tick


def reboot(rig: GoalRig) -> int:
    since = rig.line.tick
    rig.reboot_board()
    rig.probe.wait_for_state("nominal")
    return since


def estop(rig: GoalRig) -> int:
    rig.probe.call(SetBool, "estop", data=True)
    since = rig.line.tick
    rig.probe.call(SetBool, "estop", data=False)
    return since


def pause(rig: GoalRig) -> int:
    rig.probe.call(SetBool, "pause", data=True)
    since = rig.line.tick
    rig.probe.call(SetBool, "pause", data=False)
    return since


def service(name: str, rig: GoalRig) -> int:
    rig.probe.call(Trigger, name)
    return rig.line.tick


def hang(rig: GoalRig) -> int:
    since = rig.line.tick
    rig.driver.process.send_signal(signal.SIGSTOP)
    rig.expect_still(since, "the driver hangs", HANGS_S)
    rig.driver.process.send_signal(signal.SIGCONT)
    return rig.line.tick


def discards(event: Callable[[GoalRig], int], allowed_s: float, rig: GoalRig) -> None:
    """Check that the event discards the goal: the robot must be at rest from the event on."""
    rig.drive()
    rig.wait_ticks(50)
    since = event(rig)
    rig.probe.wait_for_state("nominal")
    rig.expect_still(
        since, event.__name__ if hasattr(event, "__name__") else "a service", allowed_s
    )


def ended(number: signal.Signals, rig: GoalRig) -> None:
    """Check that the robot stops when a signal ends the driver."""
    rig.drive()
    since = rig.line.tick
    rig.driver.process.send_signal(number)
    rig.expect_ended(0, -number)
    rig.expect_still(since, "the driver ends", 0.0)


GOALS: Final[dict[str, Callable[[GoalRig], None]]] = {
    f"a goal, and {name}": partial(discards, event, allowed_s)
    for name, event, allowed_s in (
        ("the wire from the board is cut", cut_from_the_board, UNHEARD_S),
        ("both wires of the cable are cut", cut_both_ways, TIMEOUT_S),
        ("unplugged, plugged in", unplugged, 2.0),
        ("the kernel's buffer is full", full_port, 0.0),
        ("the board reboots", reboot, 0.0),
        ("e-stop and release", estop, 0.0),
        ("~/pause with true, then false", pause, 0.0),
        ("~/reset", partial(service, "reset"), 0.0),
        ("~/reset_odometry", partial(service, "reset_odometry"), 0.0),
        ("the driver hangs and continues", hang, 0.0),
    )
}
GOAL_ENDINGS: Final[dict[str, Callable[[GoalRig], None]]] = {
    "a goal, and SIGKILL": partial(ended, signal.SIGKILL),
    "a goal, and ctrl-C": partial(ended, signal.SIGINT),
}
