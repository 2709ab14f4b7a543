# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Benches for the beginning of a test: the robot is at rest or drives, or the board is paused."""

from session_bench import Bench

from omnibot_driver.simulator.omnibot import BoardSettings


def standing() -> Bench:
    """Return a bench whose board is started and whose robot is at rest."""
    bench = Bench()
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    return bench


def paused() -> Bench:
    """Return a bench whose board is paused and sends its «Paused» text.

    The driver is set not to start the board.
    """
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state("paused")
    return bench


def driving(**settings: object) -> Bench:
    """Return a bench whose robot drives at 0.4 m/s by a command that was just sent."""
    bench = Bench(BoardSettings(running=True, **settings))  # type: ignore[arg-type]
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    drive_on(bench)
    assert not bench.still()
    return bench


def drive_on(bench: Bench) -> None:
    for _ in range(5):
        bench.drive(0.4)
        bench.run(0.1)


def estop(bench: Bench, active: bool) -> str:
    said = bench.session.estop(active, bench.now)
    bench.settle()
    return said


def reconnect(bench: Bench) -> None:
    bench.close()
    bench.open()


def push(bench: Bench, x_m: float, y_m: float, yaw_rad: float) -> None:
    """Push the robot by hand within one tick. Its wheels roll, so the board measures the motion."""
    odometry = bench.board._odometry
    odometry.pose = odometry.pose.moved(x_m, y_m, yaw_rad)
