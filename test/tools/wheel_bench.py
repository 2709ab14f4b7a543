# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Recorded steps of one simulated wheel. The simulation runs faster than real time."""

import math
import random
import struct
from typing import Any

import numpy as np

from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard
from omnibot_driver.simulator.omnibot.motors import TICK_S, MotorConstants, WheelGains
from omnibot_driver.tools.calibrate.log import Commands, Wheels

LSB_PER_RADPS = 70.0 * 0.029
LEVELS = (8 / LSB_PER_RADPS, 24 / LSB_PER_RADPS)
COUNT_RAD = math.tau / 1560
SENT_BEFORE_S = 0.0015


def steps_to_and_fro(
    motor: MotorConstants, gains: WheelGains | None = None, *, hold_s: float = 1.5, steps: int = 8
) -> tuple[Commands, Wheels]:
    """Return the commands to wheel A and its measured rates.

    The wheel alternates between two speeds. The commands arrive at random moments of the control
    tick.
    """
    settings: dict[str, Any] = {} if gains is None else {"wheel_gains": gains}
    board = SimulatedBoard(
        BoardSettings(running=True, frame="wheel_counts", motors=(motor,) * 3, **settings)
    )
    moments = random.Random(7)
    plan = [(0.1 + hold_s * n + 0.04 * moments.random(), n % 2) for n in range(steps + 1)]
    commands, wheels = [(0.0, 0.0, 0.0, 0.0)], []
    while board.tick * TICK_S < 0.1 + hold_s * (steps + 1):
        while plan and plan[0][0] < (board.tick + 1) * TICK_S:
            at_s, level = plan.pop(0)
            board.receive(
                b"\xff\xfe\x02" + struct.pack(">3h", round(LEVELS[level] * LSB_PER_RADPS), 0, 0)
            )
            commands.append((at_s - SENT_BEFORE_S, LEVELS[level], 0.0, 0.0))
        sent = board.step()
        if (at := sent.find(b"\xff\xfb", 14)) >= 0:
            counts = struct.unpack_from(">3h", sent, at + 2)
            wheels.append((board.tick * TICK_S, *(n * COUNT_RAD / (4 * TICK_S) for n in counts)))
    told, heard = np.array(commands), np.array(wheels)
    return Commands(told[:, 0], told[:, 1:]), Wheels(heard[:, 0], heard[:, 1:], heard[:, 1:])
