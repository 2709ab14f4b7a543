# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Print the reaction times of the motion monitor, a table for internals/motion_monitor.md.

To print the table, call:

    PYTHONPATH=test/core .venv/bin/python test/integrity/detection_times.py

A reaction time begins when the velocity differs from the command by 0.05 m/s or 0.15 rad/s. It ends
when the driver sends Stop. The times are measured by the simulated clock.
"""

from collections.abc import Callable

from disobedient_robots import (
    PERIOD_S,
    SLOWLY,
    Triple,
    by_velocity,
    by_wheels,
    on_the_wrong_switch,
    started,
    stopped_after_s,
)
from session_bench import STOP, TICK_S, Bench

from omnibot_driver.simulator.omnibot import BoardSettings

PERIODS_S = 0.04, 0.1
"""Periods of the displacements, in s."""


def robot(**settings: object) -> Callable[[float], Bench]:
    """Return a function that makes a test bench: a driver's session and a robot at rest.

    ``settings``: settings of the robot. The returned function has one argument: the period of the
    displacements, in s.
    """
    return lambda period_s: started(
        BoardSettings(running=True, delta_period_s=period_s, **settings)  # type: ignore[arg-type]
    )


def gripped_after_s(bench: Bench, command: Triple, motion: Triple) -> float:
    """Drive a robot with ``command``. Then let it move with the velocity ``motion`` instead.

    Return the time in s from this change until the driver sends Stop.
    """
    if any(command):
        for _ in range(15):
            by_velocity(bench, command)
            bench.run(PERIOD_S)
    mark, begun = len(bench.written), bench.now
    bench.board.grip(*motion)
    while not any(data == STOP for _, data in bench.written[mark:]):
        if any(command) and bench.board.tick % 10 == 0:
            by_velocity(bench, command)
        bench.run(TICK_S)
        if bench.now > begun + 3.0:
            raise AssertionError("never stopped")
    return bench.now - begun


def row(
    what: str,
    command: Triple,
    time_s: Callable[[Bench], float],
    make: Callable[[float], Bench],
) -> None:
    """Print a row of the table: the shortest and the longest reaction time.

    The motion can begin at any tick between two displacements. The function measures one reaction
    time for each of these ticks.
    """
    shown = []
    for period_s in PERIODS_S:
        times = []
        for phase in range(round(period_s / TICK_S)):
            bench = make(period_s)
            bench.run(phase * TICK_S)
            times.append(time_s(bench))
        shown.append(f"{min(times):.2f} s to {max(times):.2f} s")
    x, y, yaw = command
    commanded = f"{yaw:g} rad/s" if yaw else f"{x or y:g} m/s" if x or y else "no motion"
    print(f"| {what} | {commanded} | {' | '.join(shown)} |", flush=True)


def main() -> None:
    print("| the robot | commanded | stopped after | with `delta_period: 0.1` |\n|---|---|---|---|")
    row(
        "has its switch on position control, 3 m from its origin",
        SLOWLY,
        lambda bench: stopped_after_s(bench, SLOWLY),
        lambda period_s: on_the_wrong_switch("earth", period_s),
    )
    for scale in (1.5, 1.6, 2.38):
        for speed in (0.05, 0.1, 0.2, 0.5):
            if scale * speed - speed > 0.0499:
                forward = (speed, 0.0, 0.0)
                row(
                    f"is {scale:g} times as fast (`linear_scale`)",
                    forward,
                    lambda bench, forward=forward: stopped_after_s(bench, forward),  # type: ignore[misc]
                    robot(linear_scale=70 / scale),
                )
    forward = (0.3, 0.0, 0.0)
    row(
        "is 2.38 times as fast, by `wheel_cmd`",
        forward,
        lambda bench: stopped_after_s(bench, forward, by_wheels),
        robot(linear_scale=70 / 2.38),
    )
    for scale, rate in ((1.6, 0.3), (1.6, 0.5), (2.38, 0.15), (2.38, 0.5)):
        turn = (0.0, 0.0, rate)
        row(
            f"turns {scale:g} times as fast (`angular_scale`)",
            turn,
            lambda bench, turn=turn: stopped_after_s(bench, turn),  # type: ignore[misc]
            robot(angular_scale=500 / scale),
        )
    for what, wiring in (
        ("the leads of motors A and B are swapped", (2, 1, 3)),
        ("the leads of motor A are reversed", (-1, 2, 3)),
    ):
        for speed in (0.05, 0.3):
            forward = (speed, 0.0, 0.0)
            row(
                what,
                forward,
                lambda bench, forward=forward: stopped_after_s(bench, forward),  # type: ignore[misc]
                robot(motor_wiring=wiring),
            )
    for what, command, motion in (
        ("suddenly goes back at 0.05 m/s", (0.05, 0.0, 0.0), (-0.05, 0.0, 0.0)),
        ("suddenly goes back at the same speed", (0.3, 0.0, 0.0), (-0.3, 0.0, 0.0)),
        ("suddenly drifts sideways by 0.1 m/s", (0.3, 0.0, 0.0), (0.3, 0.1, 0.0)),
        ("suddenly turns at 0.15 rad/s", (0.3, 0.0, 0.0), (0.3, 0.0, 0.15)),
        ("suddenly turns the other way", (0.0, 0.0, 0.15), (0.0, 0.0, -0.15)),
        ("suddenly drives at 1.19 m/s", (0.5, 0.0, 0.0), (1.19, 0.0, 0.0)),
        ("is at a standstill, and then moves at 0.05 m/s", (0.0, 0.0, 0.0), (0.05, 0.0, 0.0)),
        ("is at a standstill, and then turns at 0.15 rad/s", (0.0, 0.0, 0.0), (0.0, 0.0, 0.15)),
    ):
        row(
            what,
            command,
            lambda bench, command=command, motion=motion: gripped_after_s(  # type: ignore[misc]
                bench, command, motion
            ),
            robot(),
        )


if __name__ == "__main__":
    main()
