# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The OmniBot in the fault campaign."""

from collections.abc import Iterable
from typing import Final

from nav_msgs.msg import Odometry
from published import imu_key, not_sent, odom_key, sent_imu_key, sent_odom_key
from rig_board import RigBoard
from sensor_msgs.msg import Imu

from omnibot_driver.simulator.omnibot import BoardSettings, ReceiverKind, SimulatedBoard
from omnibot_driver.simulator.omnibot.receivers import FRAMINGS

STOP: Final = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
RECEIVERS: Final = [
    ReceiverKind(framing=framing, letters=letters)
    for letters in ("between", "anywhere")
    for framing in FRAMINGS
]


def make(settings: BoardSettings | None) -> SimulatedBoard:
    return SimulatedBoard(settings or BoardSettings())


def sent(board: SimulatedBoard) -> list[bytes]:
    """Return the frames that the board sent in the most recent tick."""
    frames = []
    for frame in reversed(board.sent):
        if frame.tick != board.tick:
            break
        frames.append(frame.data)
    return frames[::-1]


def never_sent(
    imu: Iterable[Imu], odom: Iterable[Odometry], frames: list[bytes]
) -> list[tuple[str, int, int]]:
    imu, odom = list(imu), list(odom)
    return [
        ("Imu", not_sent(map(imu_key, imu), map(sent_imu_key, frames)), len(imu)),
        ("Odometry", not_sent(map(odom_key, odom), map(sent_odom_key, frames)), len(odom)),
    ]


def lossy(number: int) -> BoardSettings:
    """Return settings of a simulated board for a line that loses bytes.

    ``number``: selects how the board finds commands, and whether it obeys an emergency stop.
    """
    receiver = RECEIVERS[number % len(RECEIVERS)]
    return BoardSettings(receiver=receiver, obeys_estop=number // len(RECEIVERS) % 2 == 0)


BOARD: Final = RigBoard(
    name="omnibot",
    make=make,
    # 0.3 m/s and 0.2 rad/s, the default command of ``Rig.drive``
    old_command=bytes.fromhex("FF FE 01 00 15 00 00 00 64"),
    stop=STOP,
    opening=bytes(8) + STOP,
    wheels=3,
    services=frozenset({"start", "pause", "reset", "reset_odometry", "estop"}),
    tuning=(
        "max_linear_speed",
        "max_angular_speed",
        "max_wheel_speed",
        "max_linear_acceleration",
        "linear_scale",
        "cmd_vel_timeout",
        "command_rate",
        "reconnect_interval",
    ),
    imu=True,
    sent=sent,
    not_sent=never_sent,
    lossy=lossy,
)
