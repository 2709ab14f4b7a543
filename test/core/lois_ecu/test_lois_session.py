# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A whole session with a simulated LOIS ECU: what stops it, what is advised, what a reset shows."""

from typing import Any

import pytest
from any_board import TICK_S, AnyBench, LoisRobot
from lois_drives import HOST_GAINS

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import Extra
from omnibot_driver.core.lois_ecu import (
    RecordKind,
    Setting,
    Stream,
    TerminalLine,
    TerminalMode,
)
from omnibot_driver.core.lois_ecu.driven_board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.readings import RecordFailed, RecordReading, TerminalLeft
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.odometry.estimator import OdometrySettings
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.simulator.lois_ecu import SimulatedLois

SETTINGS = SessionSettings(
    limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
)
FIRMWARE = pytest.mark.parametrize("firmware", ["documented", "firmware"])


class Bench(AnyBench):
    """A driver with these settings, and a board with this firmware."""

    def __init__(self, firmware: str, settings: LoisEcuSettings | None = None) -> None:
        self.lois = LoisRobot(firmware)
        super().__init__(LoisEcuBoard(settings or LoisEcuSettings()), self.lois)
        self.open()
        self.run_until(lambda: self.session.state == "nominal")
        self.run(1.5)

    @property
    def board(self) -> SimulatedLois:
        return self.lois.board

    def reset(self) -> RequestDone:
        self.session.request(Request.RESET, "token", self.now)
        self.settle()
        before = len(self.answers)
        self.run_until(lambda: len(self.answers) > before)
        return self.answers[-1]

    @property
    def answers(self) -> list[RequestDone]:
        return [event for event in self.events if isinstance(event, RequestDone)]

    def presses(self, pressed: bool) -> None:
        self.board.press(pressed)
        self.run(0.5)


@FIRMWARE
def test_a_held_button_keeps_the_estop_latched(firmware: str) -> None:
    """The board itself would obey set-points while it is held."""
    bench = Bench(firmware)
    bench.drive_on()
    bench.presses(True)
    assert bench.session.estop_active
    with pytest.raises(RequestRefused, match="not released"):
        bench.estop(False)
    with pytest.raises(CommandRefused, match="e-stop is latched"):
        bench.drive()
    bench.presses(False)
    assert bench.session.estop_active
    bench.estop(False)
    bench.drive_on()
    assert not bench.robot.stands


def test_the_motion_monitor_names_this_boards_parameters() -> None:
    """It names none of another board's; without a ~/start the e-stop's release ends the refusal."""
    bench = Bench("documented", LoisEcuSettings(ticks_per_revolution=25))
    for _ in range(2):
        with pytest.raises(CommandRefused, match="motion monitor"):
            bench.drive_on(seconds=5.0)
        bench.run(2.0)
    told = " ".join(bench.notices)
    assert "`ticks_per_revolution`" in told
    assert "control_method" not in told
    assert "~/start" not in told
    with pytest.raises(CommandRefused, match="latch and release the e-stop"):
        bench.drive()
    bench.estop(True)
    bench.estop(False)
    bench.drive()
    bench.run(0.2)
    assert bench.session.figures(bench.now).commands.interlock == ""


@FIRMWARE
@pytest.mark.parametrize("seconds", [6.0, 1.2])
def test_a_reset_is_proved_by_counters_that_leap_to_zero(firmware: str, seconds: float) -> None:
    """Also by a few ticks, where the wheels stood before."""
    bench = Bench(firmware)
    bench.drive_on(0.2, seconds)
    bench.run(3.0)
    ticks = bench.board.wheels[0].ticks
    assert ticks > 2
    done = bench.reset()
    assert (done.success, done.message) == (True, "the board was reset")
    assert [wheel.ticks for wheel in bench.board.wheels] == [0, 0]


@FIRMWARE
def test_a_reset_that_nothing_can_show_says_so(firmware: str) -> None:
    """The counters were zero before; it is still sent more than once."""
    bench = Bench(firmware)
    before = len(bench.written)
    done = bench.reset()
    assert done.success
    assert "unconfirmed" in done.message
    assert "0 and 0 ticks" in done.message
    sent = b"".join(data for _, data in bench.written[before:])
    assert sent.count(b":180000000033\n") >= 2


@FIRMWARE
def test_a_reset_that_is_lost_is_not_counted_as_done(firmware: str) -> None:
    """Although there were fewer than twenty ticks."""
    bench = Bench(firmware)
    bench.drive_on(0.2, 1.2)
    bench.run(3.0)
    assert 2 < bench.board.wheels[0].ticks < 20
    bench.hears = False
    bench.session.request(Request.RESET, "token", bench.now)
    bench.settle()
    bench.run(1.9)
    assert not bench.answers
    bench.hears = True
    bench.run_until(lambda: bool(bench.answers))
    assert bench.answers[-1].message == "the board was reset"
    assert bench.board.wheels[0].ticks == 0


GPS = LoisEcuSettings(terminal_mode=TerminalMode.GPS)
COMPASS = LoisEcuSettings(terminal_mode=TerminalMode.COMPASS)


def told(bench: Bench, kind: type) -> list[Any]:
    """Values of this kind that were passed on."""
    return [
        event.value
        for event in bench.events
        if isinstance(event, Extra) and isinstance(event.value, kind)
    ]


def configure(bench: Bench, settings: LoisEcuSettings) -> None:
    """As the node does it when parameters change."""
    bench.session.configure(SETTINGS, bench.now, board=settings)
    bench.settle()


@FIRMWARE
def test_a_terminal_mode_stops_first_and_refuses_motion(firmware: str) -> None:
    """The mode is written when the robot stands; then lines of the sensor are passed on."""
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    begun = len(bench.written)
    configure(bench, COMPASS)
    stood: list[bool] = []
    while bench.board.terminal_mode == 0:
        with pytest.raises(CommandRefused, match="terminal_mode is compass"):
            bench.drive()
        bench.run(0.05)
        stood.append(bench.board.standing)
        assert len(stood) < 200
    assert stood[-1]
    assert bench.written[begun][1].startswith(b":01000000003b\n")
    bench.run(2.0)
    assert told(bench, TerminalLine)[-1].text.startswith("$HCHDT")
    assert bench.robot.stands
    bench.drive(0.0)


@FIRMWARE
@pytest.mark.parametrize("hears", [True, False])
def test_out_of_a_terminal_mode_the_correction_is_back_and_the_button_is_unknown(
    firmware: str, hears: bool
) -> None:
    """Said once; also where the first lines that end the mode are lost."""
    bench = Bench(firmware)
    configure(bench, GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    bench.run(2.0)
    assert not told(bench, TerminalLeft)
    bench.hears = hears
    configure(bench, LoisEcuSettings())
    bench.run(1.3)
    bench.hears = True
    bench.run_until(lambda: bool(told(bench, TerminalLeft)))
    bench.run(2.0)
    assert len(told(bench, TerminalLeft)) == 1
    assert bench.board.terminal_mode == 0
    assert bench.board.wheels[0].short_correction == pytest.approx(1.0761719)
    bench.drive_on()
    assert not bench.robot.stands


def test_a_board_that_restarts_in_a_terminal_mode_is_put_back_into_it() -> None:
    """With its settings before."""
    bench = Bench("firmware", GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    bench.run(1.0)
    bench.board.reboot()
    bench.run(2.5)
    assert bench.board.terminal_mode == 0
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    assert bench.board.wheels[0].controller.gains.low_pass == 1.0


@FIRMWARE
def test_an_estop_is_obeyed_in_a_terminal_mode(firmware: str) -> None:
    """Its release moves nothing."""
    bench = Bench(firmware)
    configure(bench, GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    bench.estop(True)
    bench.run(0.5)
    assert bench.board.commands[-1].command in (0x01, 0x02)
    bench.estop(False)
    with pytest.raises(CommandRefused, match="terminal_mode is gps"):
        bench.drive()


@FIRMWARE
def test_another_drive_mode_stops_first(firmware: str) -> None:
    """Motion is refused until the robot stands, then it goes by duty."""
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty"))
    with pytest.raises(CommandRefused, match="drive_mode becomes duty"):
        bench.drive()
    bench.run_until(lambda: bench.robot.stands)
    with pytest.raises(CommandRefused, match="wait"):
        bench.drive()
    bench.run(1.0)
    bench.drive_on(0.3, 2.0)
    assert bench.board.commands[-1].command == 0x01
    assert not bench.robot.stands


@pytest.mark.slow
@FIRMWARE
def test_a_long_record_is_heard_while_it_comes(firmware: str) -> None:
    """It takes 1.2 s, in which nothing else comes; the robot is driven on."""
    bench = Bench(firmware)
    bench.drive_on(0.6, 2.0)
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    board.record(RecordKind.RPM, 1024)
    while not told(bench, RecordReading):
        bench.drive(0.6)
        bench.run(0.05)
        assert bench.session.state == "nominal"
    (reading,) = told(bench, RecordReading)
    assert len(reading.record.left) == len(reading.record.right) == 1024
    assert not [notice for notice in bench.notices if "checksums" in notice]


def test_a_latched_estop_does_not_jam_a_board_that_passes_it_on_to_the_compass() -> None:
    """The public firmware reads no faster than the compass, 4800 baud: Stop alone goes out."""
    bench = Bench("firmware")
    configure(bench, COMPASS)
    bench.run_until(lambda: bench.board.terminal_mode == 2)
    bench.estop(True)
    bench.run(3.0)
    obeyed = len(bench.board.commands)
    bench.run(1.0)
    assert len(bench.board.commands) - obeyed > 10
    configure(bench, LoisEcuSettings())
    bench.run_until(lambda: bench.board.terminal_mode == 0)


def test_a_long_record_is_not_taken_for_damage() -> None:
    """Its lines are right, although none of them is a report."""
    bench = Bench("firmware")
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    board.record(RecordKind.TORQUE, 60)
    advice: set[str | None] = set()
    while not told(bench, RecordReading):
        bench.run(0.01)
        advice.add(board.advice)
        assert not told(bench, RecordFailed)
    assert all(one is None or "own left_kp" in one for one in advice)


def test_a_board_that_lost_power_within_a_line_sends_nothing() -> None:
    """The rest of a line is not a sign of a wrong baud rate."""
    bench = Bench("firmware")
    while not bench.board._uart.sending:
        bench.run(0.01)
    bench.lois.advance = lambda: []  # type: ignore[method-assign]
    bench.session.receive(b":1200", bench.now)
    bench.run(2.0)
    said = " ".join(str(event) for event in bench.events)
    assert "no data from the board" in said
    assert "makes sense" not in said


def test_a_terminal_mode_ends_a_record() -> None:
    """The board would send it into silence."""
    bench = Bench("firmware")
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    board.record(RecordKind.TORQUE, 500)
    bench.run(0.5)
    configure(bench, GPS)
    bench.run(0.5)
    assert "terminal_mode is gps" in told(bench, RecordFailed)[0].reason
    with pytest.raises(RequestRefused, match="terminal_mode is gps"):
        board.record(RecordKind.TORQUE, 500)


OFF = dict.fromkeys((Stream.HEADING, Stream.GPS_POSITION, Stream.GPS_TIME), 0xFFFF)


@pytest.mark.parametrize("count", range(1, 13))
def test_every_setting_arrives_however_many_there_are(count: int) -> None:
    """A round of them may take as long as the board takes from group to group: then the same line
    was lost in each of five rounds."""
    names = [setting for setting in Setting if setting != Setting.RPM_LOW_PASS][:count]
    quiet = {Stream.TICKS: 200, Stream.ODOMETRY: 200, **OFF}
    bench = Bench("firmware")
    written = dict.fromkeys(names, 0.5)
    configure(bench, LoisEcuSettings(periods_ms=quiet, written=written))
    bench.run(3.5)
    arrived = {line.command for line in bench.board.commands if line.payload == 0x3F000000}
    assert arrived == {int(setting) for setting in names}


@FIRMWARE
def test_a_host_that_reads_late_gets_several_groups_at_once(firmware: str) -> None:
    """They have one arrival time; the robot is driven on, and odometry goes on."""
    bench = Bench(firmware, HOST_GAINS)
    for _ in range(8):
        late: list[bytes] = []
        for step in range(60):
            bench.now += TICK_S
            late += [data for _, data in bench.robot.advance()]
            if step % 10 == 0:
                bench.drive(0.3)
        bench.session.receive(b"".join(late), bench.now)
        bench.session.tick(bench.now)
        bench.settle()
    bench.run(2.0)
    assert bench.odometry[-1].pose.x_m == pytest.approx(bench.robot.way_m, abs=0.15)
