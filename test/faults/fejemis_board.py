# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Fejemis in the fault campaign: two ports, lines of text with checksums, one robot.

Published messages are not compared with data from the boards, which send at different rates.
"""

import re
from collections.abc import Mapping
from typing import Any, Final

from cases import Case, survivable
from rig import Rig
from rig_board import RigBoard

from omnibot_driver.simulator.common.board import Packet
from omnibot_driver.simulator.fejemis import CHANNELS, FejemisSettings, SimulatedFejemis

TICKS: Final = 5
"""Number of ticks of the simulated boards in one tick of the fault campaign."""
SILENCE_S: Final = 1.6
ANGLE_S: Final = 0.2
MOTION: Final = re.compile(rb"^(?:;\d\d)?((?:rc|stop|start)[^\n]*?) *(\n)", re.MULTILINE)


class Pair:
    """Both simulated Teensys, with the interface of a single board.

    ``tick``: number of ticks of the fault campaign so far, each of ``TICKS`` ticks of the boards.

    ``received``: motion commands to the drive board, without checksums and padding.
    """

    channels = CHANNELS

    def __init__(self, settings: FejemisSettings | None) -> None:
        self.pair = SimulatedFejemis(settings)
        self.tick = 0

    @property
    def received(self) -> bytearray:
        return bytearray(
            b"".join(text + end for text, end in MOTION.findall(bytes(self.pair.drive.received)))
        )

    @property
    def driven(self) -> bool:
        return self.pair.drive.speeds_mps != (0.0, 0.0)

    def receive(self, data: bytes, at_s: float | None = None, channel: int = 0) -> None:
        self.pair.receive(data, at_s or 0.0, channel)

    def advance(self) -> list[Packet]:
        self.tick += 1
        return [packet for _ in range(TICKS) for packet in self.pair.advance()]

    def reboot(self) -> None:
        self.pair.reboot()

    @property
    def facts(self) -> Mapping[str, object]:
        return self.pair.facts


def _befall(rig: Rig, half: str, what: str) -> None:
    with rig.terminal.lock:
        rig.line.board.pair.befall(half, what)


def half_restarts(half: str) -> Any:
    """Make a case in which one Teensy (``half``) restarts.

    The commands end before the restart. Otherwise the restarted Teensy would obey the next command
    at once.
    """

    def case(rig: Rig) -> None:
        rig.drive()
        since = rig.line.tick
        rig.hand.leave()
        _befall(rig, half, "restart")
        rig.expect_still(since, f"{half} restarts")
        rig.probe.wait_for_state("nominal")

    return case


def half_is(half: str, what: str, allowed_s: float) -> Any:
    """Make a case in which one Teensy (``half``) has the fault ``what`` while the robot drives.

    ``allowed_s``: time limit in s for the robot's stop during the fault; 0 if no stop is needed.
    """

    def case(rig: Rig) -> None:
        rig.drive()
        since = rig.line.tick
        _befall(rig, half, what)
        if allowed_s:
            rig.expect_still(since, f"{half} is {what}", allowed_s)
        else:
            rig.probe.wait_for_state("connecting")
        rig.hand.leave()
        _befall(rig, half, "well")
        _befall(rig, half, "sensor-well") if half == "front" else None
        rig.probe.wait_for_state("nominal")
        rig.expect_still(rig.line.tick, f"{half} is well again", 0.5)

    return case


CASES: Final = {
    "the drive half sends nothing, but obeys": half_is("drive", "silent", SILENCE_S),
    "the drive half restarts": half_restarts("drive"),
    "the drive half is unplugged (it drives until it is plugged in)": half_is(
        "drive", "unplugged", 0.0
    ),
    "the drive half hangs (it drives until it runs again)": half_is("drive", "hung", 0.0),
    "the front half sends nothing, but obeys": half_is("front", "silent", ANGLE_S),
    "the front half restarts": half_restarts("front"),
    "the front half is unplugged": half_is("front", "unplugged", ANGLE_S),
    "the front half hangs": half_is("front", "hung", ANGLE_S),
    "the angle sensor is broken (Hall element)": half_is("front", "hall-broken", ANGLE_S),
    "the angle sensor reports an error": half_is("front", "sensor-error", ANGLE_S),
    "the angle sensor is absent": half_is("front", "sensor-absent", ANGLE_S),
}


def cases(seed: int) -> dict[str, Case[Rig]]:
    """Return the cases of any serial line and the cases of the Teensys, by the name of the case."""
    return {**survivable(seed), **CASES}


BOARD: Final = RigBoard(
    name="fejemis",
    make=Pair,
    parameters={"board": "fejemis"},
    ports=lambda link: {"port": f"{link}-drive", "front_port": f"{link}-front"},
    old_command=b";07rc 2 0.4 0\n",
    stop=b"rc 2 0 0\n",
    opening=b"rc 2 0 0\n",
    ends_later_s=1.0,  # two ports are opened and closed
    wheels=2,
    services=frozenset({"start", "pause", "reset_odometry", "estop"}),
    tuning=(
        "max_linear_speed",
        "max_angular_speed",
        "max_linear_acceleration",
        "cmd_vel_timeout",
        "command_rate",
        "reconnect_interval",
    ),
    imu=True,
    cases=cases,
    without=frozenset(
        {
            "wheel_cmd has the wrong size",
            "two commanders in turn",  # the second one uses wheel_cmd
            "~/reset",
            "SIGTERM while a call is pending",  # it calls ~/reset
            # At each attempt, the driver receives some data.
            "the kernel's buffer stays full, with one warning",
            "e-stop into a full port",  # it checks frames of the OmniBot
            "faults_of_the_network",
            "faults_of_goals",
            "goal_ending",
            "random_input",
            "walk",
            "walk_with_goals",
            "busy_computer",
        }
    ),
)
