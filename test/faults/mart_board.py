# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The MART controller in the fault campaign. It sends only replies, and its moves block it.

In the cases "beyond what is assumed", the network is worse than the driver assumes.
"""

import socket
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, Final

from breakable_line import TICK_S, Damage, cut, whole
from cases import COMMANDS, HOST, Case
from rig import TIMEOUT_S, Rig
from rig_board import RigBoard
from std_srvs.srv import SetBool

from omnibot_driver.simulator.common.board import Packet
from omnibot_driver.simulator.common.network import FaultyNetwork, NetworkFaults
from omnibot_driver.simulator.common.serving import ServedBoard
from omnibot_driver.simulator.mart import MartSettings, SimulatedMart

TICKS: Final = 5
"""Number of time steps of the simulated controller in one time step of the campaign."""
LATE_S: Final = 0.3
"""Longest delay of a datagram in each direction, in s. It equals ``network_delay``."""
LOST_STOP_S: Final = 1.2
"""Longest delay of a stop, in s, if its first two datagrams are lost."""
BLIND_S: Final = 2.0
"""Longest time in s until a robot must stop if its driver gets no replies.

It includes the time that a slow reply may take.
"""
NETWORK_S: Final = 90.0
"""Longest time in s until a robot on a bad network begins to drive.

The driver must first verify that the IMU works.
"""
STRAY_S: Final = 2.5
"""Longest time in s until the driver must stop a robot that another program drives."""


class Board(SimulatedMart):
    """The simulated controller, with the additional properties that the fault campaign uses."""

    def __init__(self, settings: MartSettings) -> None:
        super().__init__(settings)
        self.tick = 0

    @property
    def driven(self) -> bool:
        return self.server.chassis.powered

    @property
    def received(self) -> bytes:
        """Always empty, so that the last bytes that the board received are not checked.

        The driver of a MART still sends queries after its last stop.
        """
        return b""


class MartLine:
    """A simulated controller on a network, with the interface of ``BreakableLine``."""

    tick_s = TICK_S

    def __init__(self, kind: RigBoard, settings: Any = None) -> None:
        self.board = kind.make(settings)
        self.channels = self.board.channels
        self.to_board: Damage = whole
        self.from_board: Damage = whole
        self.sent: list[bytes] = []
        self.driven_at = -1
        self.network(NetworkFaults())

    def network(self, faults: NetworkFaults) -> None:
        """Let the network have the faults ``faults`` from now on."""
        self._paths = [FaultyNetwork(faults, f"{self.board.tick} {n}") for n in (0, 1)]

    @property
    def tick(self) -> int:
        return int(self.board.tick)

    def heal(self) -> None:
        self.to_board = self.from_board = whole
        self.network(NetworkFaults())

    def receive(self, data: bytes, at_s: float | None = None, channel: int = 0) -> None:
        if self.to_board(data):
            self._paths[channel].to_board.send(data, self.board.now_s)

    def advance(self) -> list[Packet]:
        out: list[Packet] = []
        for _ in range(TICKS):
            now_s = self.board.now_s
            for channel, path in enumerate(self._paths):
                for data in path.to_board.arrived(now_s):
                    self.board.receive(data, now_s, channel)
            for channel, data in self.board.advance():
                if self.from_board(data):
                    self._paths[channel].from_board.send(data, now_s)
        for channel, path in enumerate(self._paths):
            out += [(channel, data) for data in path.from_board.arrived(self.board.now_s)]
        self.board.tick += 1
        if self.board.driven:
            self.driven_at = self.tick
        return out

    def step(self) -> bytes:
        self.advance()
        return b""


def line_of(rig: Rig) -> Any:
    return rig.line


def on_a_network(faults: NetworkFaults, allowed_s: float, rig: Rig) -> None:
    """Stop publishing commands while the robot drives on a network with the faults ``faults``.

    The network may delay the stop by ``allowed_s``.
    """
    line_of(rig).network(faults)
    for twist in ((0.3, 0.2), (-0.2, 0.0), (0.0, 0.5)):
        rig.hand.hold(twist[0], 0.0, twist[1])
        assert rig.wait_for_board(lambda line: line.board.driven, NETWORK_S), rig.driver.output
        rig.wait_ticks(100)
        rig.hand.leave()
        rig.expect_still(rig.line.tick, "the publisher ceases", TIMEOUT_S + allowed_s)
    rig.line.heal()


def replies_are_cut(rig: Rig) -> None:
    """Cut the controller's replies. The controller still receives the stop."""
    rig.drive()
    rig.line.from_board = cut
    rig.expect_still(rig.line.tick, "no replies come", BLIND_S)
    rig.hand.leave()
    rig.line.heal()
    _wait_until_served(rig)


def network_is_away(seconds: float, rig: Rig) -> None:
    """Cut the network in both directions for ``seconds``, then check that the robot stops.

    While the network is cut, the robot drives on, because no stop can reach the controller.
    """
    rig.drive()
    rig.line.from_board = rig.line.to_board = cut
    rig.wait_ticks(round(seconds / TICK_S))
    rig.hand.leave()
    rig.line.heal()
    rig.expect_still(rig.line.tick, "the network is back", LOST_STOP_S)
    _wait_until_served(rig)


def _wait_until_served(rig: Rig) -> None:
    """Wait until the driver receives the controller's replies again."""
    rig.wait_ticks(400)
    rig.probe.wait_for_state("nominal")


def server_is_restarted(rig: Rig) -> None:
    rig.drive()
    since = rig.line.tick
    rig.reboot_board()
    rig.hand.leave()
    rig.expect_still(since, "the server is restarted")
    _wait_until_served(rig)


def estop_through_a_restart(rig: Rig) -> None:
    rig.drive()
    answer = rig.probe.call(SetBool, "estop", data=True)
    rig.findings.expect(answer.success, "the e-stop was refused")
    since = rig.line.tick
    rig.reboot_board()
    rig.wait_ticks(300)
    rig.expect_still(since, "e-stop while commands continue", 0.0)
    rig.hand.leave()
    since = rig.line.tick
    rig.probe.call(SetBool, "estop", data=False)
    rig.expect_still(since, "the e-stop is released", 0.0)


def another_client(said: bytes, rig: Rig) -> None:
    """Let another client start a motion while the robot is at rest. The driver must end the motion.

    ``said``: the datagram that the client sends to start the motion.
    """
    rig.wait_ticks(350)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        port = int(rig.port.rpartition(":")[2])
        client.sendto(said, ("127.0.0.1", port))
        assert rig.wait_for_board(lambda line: line.board.driven)
    rig.expect_still(rig.line.tick, f"another client says {said.decode()}", STRAY_S)


def imu_dies(rig: Rig) -> None:
    """Let the IMU fail while the robot drives by the command RM. The robot must stop.

    The controller's server hangs after this stop, so this function finally restarts the server.
    """
    rig.drive()
    rig.wait_ticks(100)
    since = rig.line.tick
    _change(rig, lambda board: setattr(board.server.imu, "alive", False))
    rig.expect_still(since, "the IMU dies", 1.5)
    rig.hand.leave()
    rig.wait_ticks(600)
    _change(rig, lambda board: setattr(board.server.imu, "alive", True))
    _change(rig, lambda board: board.server.restart())
    _wait_until_served(rig)


def _change(rig: Rig, action: Callable[[Any], object]) -> None:
    with rig.terminal_lock:
        action(rig.line.board)


ASSUMED: Final = {
    "10 % of the datagrams are lost": NetworkFaults(lose=0.1),
    "10 % come twice, all are late by up to 0.3 s": NetworkFaults(duplicate=0.1, delay_s=LATE_S),
    "10 % are lost, 10 % come twice, all are late by up to 0.3 s": NetworkFaults(
        lose=0.1, duplicate=0.1, delay_s=LATE_S
    ),
}


def cases(_seed: int) -> dict[str, Case[Rig]]:
    """Return all cases that one driver goes through. The keys are their names."""
    mine = {name: case for name, case in COMMANDS.items() if not name.startswith("wheel_cmd")}
    return {
        **mine,
        **{
            f"the network: {name}": partial(on_a_network, faults, LOST_STOP_S)
            for name, faults in ASSUMED.items()
        },
        "beyond what is assumed: no replies come": replies_are_cut,
        "beyond what is assumed: the network is away for 1 s": partial(network_is_away, 1.0),
        "beyond what is assumed: the network is away for 4 s": partial(network_is_away, 4.0),
        "the server is restarted": server_is_restarted,
        "e-stop through a restart of the server": estop_through_a_restart,
        "another client sends RM": partial(another_client, b"RM 30"),
        "another client sends L": partial(another_client, b"L SLOW"),
        "the driver hangs and continues (SIGSTOP, SIGCONT)": HOST[
            "the driver hangs and continues (SIGSTOP, SIGCONT)"
        ],
        "the IMU dies while RM drives; the server is restarted": imu_dies,
    }


def _network_is(faults: NetworkFaults) -> Callable[[Rig, Random], None]:
    return lambda rig, _random: line_of(rig).network(faults)


def _replies_cease(rig: Rig, _random: Random) -> None:
    rig.line.from_board = cut


def _network_is_cut(rig: Rig, _random: Random) -> None:
    rig.line.from_board = rig.line.to_board = cut


def _heals(rig: Rig, _random: Random) -> None:
    rig.heal()


def _restarts(rig: Rig, _random: Random) -> None:
    rig.reboot_board()


STEPS: Final = {
    **{name: _network_is(faults) for name, faults in ASSUMED.items()},
    "no replies come": _replies_cease,
    "a cut": _network_is_cut,
    "a whole network": _heals,
    "the server is restarted": _restarts,
}


def serve(line: Any, url: str) -> ServedBoard[Any]:
    """Return a server that offers the controller at the UDP port of this address."""
    return ServedBoard(line, udp_port=int(url.rpartition(":")[2]))


def url(_folder: Path) -> str:
    """Return the address of the first of two free ports with consecutive numbers."""
    for _ in range(100):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first:
            first.bind(("127.0.0.1", 0))
            number = int(first.getsockname()[1])
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second:
                try:
                    second.bind(("127.0.0.1", number + 1))
                except OSError:
                    continue
                return f"udp://127.0.0.1:{number}"
    raise OSError("no two UDP ports in a row are free")


BOARD: Final = RigBoard(
    name="mart",
    make=lambda settings: Board(settings or MartSettings()),
    parameters={"board": "mart"},
    old_command=b"",
    stop=b"",
    opening=b"",
    wheels=0,
    services=frozenset({"reset_odometry", "estop"}),
    tuning=(),
    off_within_s=0.3,  # a stop during a start waits until the motion has begun
    ends_later_s=2.0,
    imu=False,
    jump_stddevs=4.0,
    line=MartLine,
    serve=serve,
    port=url,
    cases=cases,
    steps=STEPS,
    rests_later_s=BLIND_S,
    without=frozenset(
        {
            "faults_of_the_network",  # the faults of a server of serial lines
            "faults_of_goals",
            "goal_ending",
            "losses",
            "random_input",
            "walk",
            "walk_with_goals",
            "busy_computer",
            "ctrl-C, plugged in but not yet open again",
            "SIGTERM while a call is pending",  # it calls ~/reset
            "SIGINT while the port is full",
            "an exception while the port is full",
            "SIGKILL while the port is full",
        }
    ),
)
