# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Scripted faults: each occurs while a commander drives the robot, and the robot must then stop.

A case is a function whose argument is a rig. The robot is at rest before and after the case.
"""

import signal
from collections.abc import Callable
from functools import partial
from random import Random
from typing import Final, TypeVar

from breakable_line import Damage, cut, gaining, late, losing, losing_bursts, noise
from driver_process import Driver
from geometry_msgs.msg import Twist
from hostile_clients import UNKIND
from rig import TICK_S, Rig
from std_msgs.msg import Bool, Float32MultiArray
from std_srvs.srv import SetBool, Trigger
from stuck import TERMINAL

R = TypeVar("R", bound=Rig, contravariant=True)
Case = Callable[[R], object]

NONSENSE: Final = (float("nan"), float("inf"), -float("inf"))
HANGS_S: Final = 1.0
"""Time in s within which the guard must stop the robot if the driver hangs."""
DAMAGED_S: Final = 1.1
"""Time in s within which a robot on a damaged line must stop after the last command.

The rig adds its ``grace_s`` to this time.
"""
UNHEARD: Final = "moving without a command|stop unconfirmed"
"""Pattern of the log lines that a driver should print if the board does not receive Stop."""
NEXT_ATTEMPT_S: Final = 2.0
"""Longest time in s until the driver tries again to open a lost port."""
SILENCE_S: Final = 1.5
"""Time in s without data after which the driver regards a board as silent."""


def ticks(seconds: float) -> int:
    return round(seconds / TICK_S)


# Commanders


def publisher_ceases(rig: Rig) -> None:
    rig.drive()
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "the publisher ceases")


def publisher_sends_nonsense(rig: Rig) -> None:
    rig.drive()
    since = rig.line.tick + ticks(0.05)
    for value in NONSENSE:
        rig.hand.hold(value, 0.0, 0.0)
        rig.wait_ticks(25)
    rig.expect_still(since, "the publisher sends NaN and infinity")
    rig.hand.leave()


def wheel_commands_of_the_wrong_size(rig: Rig) -> None:
    publisher = rig.probe.publisher(Float32MultiArray, "wheel_cmd")
    rig.drive()
    rig.hand.leave()
    since = rig.line.tick
    right = rig.kind.wheels
    sizes = [[5.0] * size for size in (0, 1, 2, 3, 4, 1000) if size != right]
    for data in (*sizes, [float("nan"), *[5.0] * (right - 1)]):
        publisher.publish(Float32MultiArray(data=data))
        rig.wait_ticks(10)
    rig.expect_still(since, "wheel commands of the wrong size")
    rig.probe.remove(publisher)


def flood_of_commands(rig: Rig) -> None:
    publisher = rig.probe.publisher(Twist, "cmd_vel")
    slow, fast = Twist(), Twist()
    slow.linear.x, fast.linear.x = 0.05, 0.4
    heard = len(rig.imu)
    since, sent = rig.line.tick, len(rig.line.sent)
    while rig.line.tick < since + 300:
        before = rig.line.tick
        for _ in range(10):
            publisher.publish(slow if rig.line.tick % 2 else fast)
        rig.wait_for_board(lambda line, before=before: line.tick > before)
    rig.expect_still(rig.line.tick, "1,000 commands a second, then none")
    imus = sum(frame[:2] == b"\xff\xfa" for frame in rig.line.sent[sent:]) if rig.kind.imu else 0
    rig.probe.wait_for(lambda: len(rig.imu) - heard >= imus)
    rig.probe.remove(publisher)


# The line and the board


def damaged(to_board: Damage | None, from_board: Damage | None, seconds: float, rig: Rig) -> None:
    """Damage the bytes on the line while the robot drives for ``seconds``.

    The damage continues after the last command, until the robot must be at rest.
    """
    rig.drive()
    rig.line.to_board = to_board or rig.line.to_board
    rig.line.from_board = from_board or rig.line.from_board
    rig.wait_ticks(ticks(seconds))
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "on a damaged line", DAMAGED_S)
    rig.line.heal()
    rig.expect_still(rig.line.tick, "the line is whole again", 0.0)


def cut_to_the_board(rig: Rig) -> None:
    """Cut the line to the board. Stop cannot arrive, and the driver must report this.

    When the line is repaired, the robot must stop.
    """
    rig.drive()
    mark = len(rig.driver.lines)
    rig.line.to_board = cut
    rig.hand.leave()
    rig.driver.wait_for_line(UNHEARD, mark)
    rig.line.heal()
    rig.expect_still(rig.line.tick, "cut to the board, whole again", 1.0)


def cut_from_the_board(rig: Rig) -> None:
    rig.drive()
    rig.line.from_board = cut
    rig.expect_still(rig.line.tick, "no data from the board", SILENCE_S)
    rig.hand.leave()
    rig.line.heal()


def cut_both_ways(rig: Rig) -> None:
    rig.drive()
    rig.line.from_board = rig.line.to_board = cut
    rig.wait_ticks(ticks(3.0))
    rig.probe.wait_for_state("connecting")
    rig.hand.leave()
    rig.line.heal()
    rig.expect_still(rig.line.tick, "cut both ways, whole again")


def board_reboots(rig: Rig) -> None:
    rig.drive()
    since = rig.line.tick
    rig.reboot_board()
    rig.hand.leave()
    rig.expect_still(since, "the board reboots")


def board_reboots_while_somebody_drives_on(rig: Rig) -> None:
    """Reboot the board while commands continue.

    After the boot, these commands must move the robot again.
    """
    rig.drive()
    rig.reboot_board()
    rig.probe.wait_for_state("nominal")
    assert rig.wait_for_board(lambda line: line.board.driven), "it never moved again"
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "the commands end after a reboot")


def unplugged(rig: Rig) -> None:
    rig.drive()
    rig.hand.leave()
    rig.unplug()
    rig.probe.wait_for_state("disconnected")
    rig.wait_for_diagnosis("does not exist")
    mark = len(rig.line.board.received)
    rig.plug()
    since = rig.line.tick
    rig.expect_still(since, "unplugged while driving, plugged in again", NEXT_ATTEMPT_S)
    opening = bytes(rig.line.board.received[mark:])
    rig.findings.expect(
        opening.startswith(rig.kind.opening), f"the first bytes were {opening[:26].hex(' ')}"
    )


def unplugged_while_somebody_drives_on(rig: Rig) -> None:
    rig.drive()
    rig.unplug()
    rig.probe.wait_for_state("disconnected")
    rig.plug()
    rig.probe.wait_for_state("nominal")
    assert rig.wait_for_board(lambda line: line.board.driven), "it never moved again"
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "the commands end after the cable is plugged in")


# The e-stop and the services


def estop(rig: Rig) -> None:
    """Latch the e-stop. Then reboot the board and pull the cable while commands continue.

    The robot must stay at rest. Then the commands end, and the e-stop is released. The robot must
    still stay at rest.
    """
    rig.drive()
    answer = rig.probe.call(SetBool, "estop", data=True)
    rig.findings.expect(answer.success, "the e-stop was refused")
    since = rig.line.tick
    rig.reboot_board()
    rig.probe.wait_for_state("nominal")
    rig.unplug()
    rig.probe.wait_for_state("disconnected")
    rig.plug()
    rig.probe.wait_for_state("nominal")
    if "start" in rig.kind.services:
        rig.probe.call(Trigger, "start")
    rig.expect_still(since, "e-stop while commands continue", 0.0)
    rig.hand.leave()
    since = rig.line.tick
    rig.probe.call(SetBool, "estop", data=False)
    rig.expect_still(since, "the e-stop is released", 0.0)


def estop_by_topic(rig: Rig) -> None:
    publisher = rig.probe.publisher(Bool, "estop")
    rig.drive()
    publisher.publish(Bool(data=True))
    rig.probe.wait_for(lambda: rig.estops and rig.estops[-1].data)
    since = rig.line.tick
    publisher.publish(Bool(data=False))
    rig.expect_still(since, "e-stop by topic while commands continue", 0.0)
    rig.hand.leave()
    rig.probe.call(SetBool, "estop", data=False)
    rig.probe.remove(publisher)


def service_discards_the_command(service: str, rig: Rig) -> None:
    """Call pause and resume, or another service, while the robot drives.

    The robot must stop, and stay at rest until a fresh command.
    """
    rig.drive()
    rig.hand.leave()
    since = rig.line.tick
    if service == "pause":
        rig.probe.call(SetBool, "pause", data=True)
        rig.probe.call(SetBool, "pause", data=False)
    else:
        rig.probe.call(Trigger, service)
    rig.expect_still(since, f"~/{service}")
    rig.probe.wait_for_state("nominal")


def random_lines(seed: int, at_most_s: float) -> dict[str, Case[Rig]]:
    """Return the cases that damage bytes at random. The keys are the names of the cases.

    ``seed``: selects the damage.

    ``at_most_s``: longest time for which the robot drives on a damaged line.
    """
    random = Random(f"lines {seed}")
    return {
        "1 byte in 100 lost, both ways": partial(
            damaged, losing(1e-2, random), losing(1e-2, random), min(5.0, at_most_s)
        ),
        "1 byte in 1,000 added, from the board": partial(
            damaged, None, gaining(1e-3, random), min(5.0, at_most_s)
        ),
        "bursts of 1 to 200 bytes lost, from the board": partial(
            damaged, None, losing_bursts(5e-4, random), min(5.0, at_most_s)
        ),
        "noise instead of the board": partial(damaged, None, noise(random), min(2.0, at_most_s)),
        "an adapter that delivers bytes 0.3 s late": partial(
            damaged, None, late(30), min(3.0, at_most_s)
        ),
    }


COMMANDS: Final[dict[str, Case[Rig]]] = {
    "the publisher of cmd_vel ends": publisher_ceases,
    "cmd_vel is NaN or infinite": publisher_sends_nonsense,
    "wheel_cmd has the wrong size": wheel_commands_of_the_wrong_size,
    "1,000 commands a second": flood_of_commands,
}
LINE: Final[dict[str, Case[Rig]]] = {
    "the wire to the board is cut": cut_to_the_board,
    "the wire from the board is cut": cut_from_the_board,
    "both wires of the cable are cut": cut_both_ways,
    "the board reboots": board_reboots,
    "the board reboots while commands continue": board_reboots_while_somebody_drives_on,
    "unplugged, plugged in under another name": unplugged,
    "unplugged and plugged in while commands continue": unplugged_while_somebody_drives_on,
}
SERVICES: Final[dict[str, Case[Rig]]] = {
    "e-stop through reboot, replug and ~/start": estop,
    "e-stop by topic; false does not release": estop_by_topic,
    "~/pause with true, then false": partial(service_discards_the_command, "pause"),
    "~/reset": partial(service_discards_the_command, "reset"),
}

# The host


def driver_hangs(rig: Rig) -> None:
    """Suspend the driver's process while commands continue.

    The guard must stop the robot. When the driver continues, the commands that have waited must not
    move the robot.
    """
    rig.drive()
    since = rig.line.tick
    rig.driver.process.send_signal(signal.SIGSTOP)
    rig.expect_still(since, "the driver hangs", HANGS_S)
    rig.hand.leave()
    since = rig.line.tick
    rig.driver.process.send_signal(signal.SIGCONT)
    rig.expect_still(since, "the driver goes on", 0.0)


def second_driver(rig: Rig) -> None:
    """Start a second driver on the same port. It must report that the port is in use, and by whom.

    The first driver must continue to drive the robot.
    """
    rig.drive()
    with Driver(**rig.ports, **rig.kind.parameters) as other:
        said = other.wait_for_line("is in use")
        rig.findings.expect(
            str(rig.driver.process.pid) in said, f"the owner's pid is not in: {said}"
        )
        driven = rig.wait_for_board(lambda line: line.board.driven)
        rig.findings.expect(driven, "the first driver was disturbed")
        rig.hand.leave()
        rig.expect_still(rig.line.tick, "with a second driver waiting")


HOST: Final[dict[str, Case[Rig]]] = {
    "the driver hangs and continues (SIGSTOP, SIGCONT)": driver_hangs,
    "a second driver on the same port": second_driver,
}


def survivable(seed: int, damaged_s: float = 5.0) -> dict[str, Case[Rig]]:
    """Return all cases that a driver must survive. The keys are their names.

    ``damaged_s``: longest time for which the robot drives on a line with random damage.
    """
    lines = random_lines(seed, damaged_s)
    return {**COMMANDS, **LINE, **TERMINAL, **lines, **SERVICES, **HOST, **UNKIND}
