# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of brush, lift and lights, and of the lines sent for them at the exit."""

import math
from collections.abc import Callable

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis.machine import Machine
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.requests import Request


def lift_it(bench: Bench, volts: float = 6.0) -> None:
    bench.board.services.lift(volts, bench.now)
    bench.settle()


def test_the_lift_runs_no_longer_than_a_command() -> None:
    """The driver sends a lift voltage with a time limit. Later lines do not reach the front board.

    The lift stops by itself when the time limit is over.
    """
    bench = nominal()
    lift_it(bench)
    bench.hears = {DRIVE}
    bench.run(0.01)
    assert bench.robot.vehicle.lift.volts == pytest.approx(6.0, abs=1.2)
    bench.run(0.44)
    assert bench.robot.vehicle.lift.volts > 0.0
    bench.run(0.1)
    assert bench.robot.vehicle.lift.volts == 0.0


def test_the_time_of_the_lift_follows_the_timeout() -> None:
    """Each lift voltage is commanded for at most ``command_timeout_s``."""
    bench = nominal(settings=FejemisSettings(command_timeout_s=0.2))
    lift_it(bench, -6.0)
    said = [text for text in bench.lines(FRONT) if text.startswith("motv -")]
    assert 0.0 < float(said[-1].split()[2]) <= 0.2
    with pytest.raises(CommandRefused, match="NaN"):
        lift_it(bench, math.nan)


def test_a_flood_of_voltages_or_colours_is_thinned_and_the_newest_wins() -> None:
    """The user commands a thousand lift voltages and colours in 1 s. About twenty of each are sent.

    The driver always sends the newest value. It sends a voltage of 0 at once.
    """
    machine = Machine()
    machine.set_brush(True)
    said: list[tuple[float, bytes]] = []
    for n in range(1000):
        now = 0.001 * n
        machine.lift(7.0 + 0.001 * n, now, 0.5)
        machine.set_colour(n % 256, 0, 0, now)
        said += [(now, text) for text in machine.due(now)]
    lifts = [text for _, text in said if text.startswith(b"motv")]
    assert len(lifts) == pytest.approx(20, abs=1)
    assert float(lifts[-1].split()[1]) == pytest.approx(7.9, abs=0.1)
    assert sum(text.startswith(b"ledb") for _, text in said) == pytest.approx(20, abs=1)
    assert sum(text == b"brush 1" for _, text in said) <= 4
    machine.lift(0.0, 1.0, 0.5)
    assert b"motv 0 0" in machine.due(1.0)
    assert not any(text.startswith(b"motv") for text in machine.due(1.06))


def test_a_voltage_that_waits_runs_for_its_whole_time() -> None:
    """The time limit of a lift voltage begins when the voltage is sent, not when it is commanded.

    Switching the lift off discards a waiting voltage.
    """
    machine = Machine()
    machine.lift(3.0, 0.0, 0.5)
    machine.due(0.0)
    machine.lift(6.0, 0.01, 0.5)
    assert machine.due(0.01) == []
    assert machine.wake_at == 0.05
    assert machine.due(0.05)[0].startswith(b"motv 6")
    assert machine.volts == 6.0
    assert machine.due(0.549) == [b"motv 0 0"]
    machine.lift(3.0, 1.0, 0.5)
    machine.due(1.0)
    machine.lift(6.0, 1.01, 0.5)
    machine.off()
    assert machine.due(1.02) == [b"motv 0 0", b"brush 0"]


def test_a_new_lift_voltage_is_not_cancelled_by_the_repeated_switching_off() -> None:
    """A new lift voltage ends the repetition of the line that switches the lift off.

    The line for the brush is still sent three times.
    """
    machine = Machine()
    machine.off()
    said = machine.due(0.0)
    machine.lift(6.0, 0.05, 0.5)
    for step in range(1, 9):
        said += machine.due(0.05 * step)
    assert said.count(b"brush 0") == 3
    assert said.count(b"motv 0 0") == 1
    assert said.index(b"motv 0 0") < said.index(b"motv 6.00 .499")
    assert not any(text.startswith(b"motv 6") for text in machine.due(1.06))


ENDS: dict[str, Callable[[Bench], object]] = {
    "e-stop": lambda bench: bench.estop(True),
    "pause": lambda bench: bench.ask(Request.PAUSE),
    "a silent front board": lambda bench: (setattr(bench, "speaks", {DRIVE}), bench.run(2.5)),
    "a silent drive board": lambda bench: (setattr(bench, "speaks", {FRONT}), bench.run(2.5)),
    "a restart of the drive board": lambda bench: bench.robot.drive.reboot(),
    "a restart of the front board": lambda bench: bench.robot.front.reboot(),
    "a lost line": lambda bench: (bench.close(), bench.open(missing="a line is missing")),
    "reconnect": lambda bench: (bench.close(), bench.open()),
}


@pytest.mark.slow
@pytest.mark.parametrize("ends", ENDS.values(), ids=ENDS)
def test_brush_and_lift_end_and_do_not_come_back(ends: Callable[[Bench], object]) -> None:
    """An event such as an e-stop or a restart stops brush and lift. They stay off afterwards."""
    bench = nominal()
    bench.board.services.set_brush(True, bench.now)
    lift_it(bench)
    bench.run(0.1)
    assert bench.robot.vehicle.brush
    ends(bench)
    bench.run(1.0)
    assert not bench.robot.vehicle.brush
    assert bench.robot.vehicle.lift.volts == 0.0
    bench.speaks = bench.hears = {DRIVE, FRONT}
    bench.close()
    bench.open()
    bench.estop(False)
    bench.run(1.5)
    assert not bench.robot.vehicle.brush
    assert not bench.board._upkeep.machine.active


def test_what_turns_is_refused_in_an_estop_and_in_a_pause() -> None:
    """During an e-stop or a pause, brush and lift may be switched off, but not on."""
    bench = nominal()
    bench.estop(True)
    with pytest.raises(RequestRefused, match="e-stop"):
        bench.board.services.set_brush(True, bench.now)
    with pytest.raises(CommandRefused, match="e-stop"):
        bench.board.services.lift(3.0, bench.now)
    bench.board.services.set_brush(False, bench.now)
    bench.board.services.lift(0.0, bench.now)
    bench.estop(False)
    bench.ask(Request.PAUSE)
    with pytest.raises(RequestRefused, match="paused"):
        bench.board.services.set_brush(True, bench.now)


def test_a_command_that_expires_leaves_the_brush_on() -> None:
    """When a motion command expires, only the wheels stop.

    The brush stays on, because a robot may sweep at rest.
    """
    bench = nominal()
    bench.board.services.set_brush(True, bench.now)
    bench.drive_on()
    bench.run(1.5)
    assert bench.robot.standing
    assert bench.robot.vehicle.brush


def test_the_lights_are_given_back_at_the_end() -> None:
    """The user has set the lights. At the exit, the driver lets the board control them again."""
    bench = nominal()
    assert not any(b"leds" in data for _, data in bench.board.switch_off())
    bench.board.services.set_led(300, 128, -5, bench.now)
    bench.settle()
    bench.run(0.5)
    assert bench.robot.front.leds == [(255, 128, 0)] * 12
    assert any(b"leds" in data for _, data in bench.board.switch_off())


@pytest.mark.slow
def test_the_guard_and_the_exit_stop_all_that_turns_on_both_lines() -> None:
    """The last lines of the guard and of the driver stop wheels, brush and lift.

    The guard has two sets of last lines: one for a latched e-stop, and one without it.
    """
    for words in ("guard", "guard latched", "exit"):
        bench = nominal()
        bench.board.services.set_brush(True, bench.now)
        lift_it(bench)
        bench.drive_on(seconds=0.4)
        stop, emergency = bench.board.last_words()
        last = {"guard": stop, "guard latched": emergency}.get(words)
        packets = last or bench.session.shutdown.sequence("stop", bench.now)
        for channel, data in packets:
            bench.robot.receive(data, bench.now, channel)
        bench.hears = bench.speaks = set()
        bench.run(1.5)
        assert bench.robot.standing, words
        assert not bench.robot.vehicle.brush, words
        assert bench.robot.vehicle.lift.volts == 0.0


@pytest.mark.parametrize("again", ["e-stop", "pause"])
def test_a_start_that_is_still_repeated_ends_with_the_next_stop(again: str) -> None:
    """The user stops the robot again while the driver still repeats ``start``.

    The driver sends no more ``start``.
    """
    bench = nominal()
    bench.estop(True)
    bench.run(0.5)
    bench.estop(False)
    bench.run(0.05)
    assert "start" in bench.lines(DRIVE)
    mark = bench.now
    if again == "e-stop":
        bench.estop(True)
    else:
        bench.session.request(Request.PAUSE, object(), bench.now)
        bench.settle()
    bench.run(1.5)
    assert "start" not in bench.lines(DRIVE, mark)
    assert bench.robot.drive.source == -1


def test_a_brush_that_the_guard_switched_off_does_not_come_back() -> None:
    """The driver stalls, and its watchdog process switches the brush off.

    After the stall, the driver does not repeat ``brush 1``.
    """
    bench = nominal()
    bench.board.services.set_brush(True, bench.now)
    bench.settle()
    bench.run(0.5)
    for channel, data in bench.board.last_words()[0]:
        bench.robot.receive(data, bench.now, channel)
    bench.session.stood_still(0.8, bench.now)
    bench.settle()
    mark = bench.now
    bench.run(2.5)
    assert "brush 1" not in bench.lines(FRONT, mark)
    assert not bench.robot.vehicle.brush


def test_no_brush_is_switched_on_at_a_front_board_that_is_not_heard() -> None:
    """The front board becomes silent while its brush is on, and may have restarted.

    The driver switches the brush off and leaves it off.
    """
    bench = nominal()
    bench.board.services.set_brush(True, bench.now)
    bench.settle()
    bench.run(0.65)
    bench.speaks = {DRIVE}
    mark = bench.now
    bench.run(2.0)
    assert "brush 1" not in bench.lines(FRONT, mark)
    assert "brush 0" in bench.lines(FRONT, mark)
    assert any("brush and lift switched off" in text for text in bench.notices)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.7, 3.0])
def test_a_front_board_that_missed_the_stop_of_its_brush_receives_it_again(seconds: float) -> None:
    """The front board hangs and does not receive the stop of its brush.

    The driver sends the stop again when the board works again.
    """
    bench = nominal()
    bench.board.services.set_brush(True, bench.now)
    bench.settle()
    bench.run(0.5)
    bench.robot.front.hung = True
    bench.run(seconds)
    assert bench.robot.vehicle.brush
    bench.robot.front.hung = False
    bench.run(0.5)
    assert not bench.robot.vehicle.brush


def test_the_brush_is_off_as_soon_as_the_driver_begins_to_end() -> None:
    """The driver shuts down. It switches the brush off before it waits for the wheels to stop."""
    bench = nominal()
    bench.board.services.set_brush(True, bench.now)
    bench.settle()
    bench.drive_on()
    mark = bench.now
    bench.session.shutdown.begin(bench.now)
    bench.settle()
    bench.run(0.05)
    assert not bench.robot.vehicle.brush
    bench.run(1.5)
    assert "brush 1" not in bench.lines(FRONT, mark)


def test_what_turns_is_switched_off_thrice_at_the_exit() -> None:
    """At the exit, the driver sends each line that stops brush or lift three times."""
    bench = nominal()
    front = [data for channel, data in bench.board.switch_off() if channel == FRONT]
    assert b"".join(front).count(b"brush 0") == 3
    assert b"".join(front).count(b"motv 0 0") == 3
