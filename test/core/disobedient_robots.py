# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Robots that do not move as commanded, and the time until the driver stops them."""

import math
from collections.abc import Callable

from session_bench import STOP, TICK_S, Bench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings

Triple = tuple[float, float, float]
PERIOD_S = 0.1
"""Period of the commands, in s."""
SLOWLY: Triple = (0.05, 0.0, 0.0)


def started(board: BoardSettings, **options: object) -> Bench:
    """Return a bench whose robot is at rest and whose list of events is empty."""
    bench = Bench(board, **options)  # type: ignore[arg-type]
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.0)
    bench.events.clear()
    return bench


def by_velocity(bench: Bench, command: Triple) -> None:
    bench.drive(*command)


def by_wheels(bench: Bench, command: Triple) -> None:
    """Command wheel rates, which are computed from the twist ``command``."""
    x, y, yaw = command
    along_x, along_y, turn = math.cos(math.radians(30)) * x, y / 2, 0.143 * yaw
    bench.turn_wheels(
        (-along_x - along_y - turn) / 0.029,
        (along_x - along_y - turn) / 0.029,
        (y - turn) / 0.029,
    )


def goes_astray(bench: Bench, command: Triple) -> bool:
    """Return whether the robot's twist is far from every twist between rest and the command.

    Far means at least 0.05 m/s or 0.15 rad/s away.
    """
    truth, (x, y, yaw) = bench.board.truth, command
    square = x * x + y * y
    part = (truth.vx_mps * x + truth.vy_mps * y) / square if square else 0.0
    part = max(0.0, min(1.0, part))
    turn = max(min(0.0, yaw), min(max(0.0, yaw), truth.yaw_rate))
    off_mps = math.hypot(truth.vx_mps - part * x, truth.vy_mps - part * y)
    return off_mps >= 0.05 or abs(truth.yaw_rate - turn) >= 0.15


def stopped_after_s(
    bench: Bench, command: Triple, by: Callable[[Bench, Triple], None] = by_velocity
) -> float:
    """Command the robot until the driver sends Stop.

    Return the time in s from the robot's first deviation from the command to this Stop.

    Raises AssertionError if Stop comes before a deviation, or not within 3 s.
    """
    begun, astray, mark = bench.now, math.inf, len(bench.written)
    first = bench.board.tick
    while bench.now < begun + 3.0:
        if (bench.board.tick - first) % 10 == 0:
            by(bench, command)
        bench.run(TICK_S)
        if goes_astray(bench, command):
            astray = min(astray, bench.now)
        if any(data == STOP for _, data in bench.written[mark:]):
            assert astray < math.inf, "stopped before the robot deviated from the command"
            return bench.now - astray
    raise AssertionError("never stopped")


def on_the_wrong_switch(frame: str, delta_period_s: float = 0.04) -> Bench:
    """Return a bench whose board is switched to position control, while the driver sends speeds.

    The board's pose is 3 m from its origin.
    """
    board = BoardSettings(
        running=True,
        control="position",
        frame=frame,
        initial_pose=BoardPose(3000.0, 0.0, 0.0),
        delta_period_s=delta_period_s,
    )
    return started(board, control="velocity")


def try_to_drive(bench: Bench, seconds: float) -> int:
    """Command a twist at 10 Hz for ``seconds``, and return how many commands are accepted."""
    taken = 0
    for _ in range(round(seconds / PERIOD_S)):
        try:
            bench.drive(*SLOWLY)
            taken += 1
        except CommandRefused:
            assert bench.session.figures(bench.now).commands.interlock
        bench.run(PERIOD_S)
    return taken
