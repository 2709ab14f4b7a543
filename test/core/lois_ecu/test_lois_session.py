# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Sessions with a simulated LOIS ECU: e-stop button, advice, resets, records, and late reads."""

import math
from dataclasses import replace

import pytest
from any_board import TICK_S
from lois_bench import FIRMWARE, SETTINGS, Bench, configure, told
from lois_drives import HOST_GAINS

from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.lois_ecu import RecordKind, SetDuty, Setting, Stream, encode_command
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.outbound import STOP
from omnibot_driver.core.lois_ecu.readings import RecordComes, RecordFailed, RecordReading
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.measurement.outlier_filter import MotionLimits
from omnibot_driver.core.packets import joined, packed
from omnibot_driver.core.requests import Request

RESET = b":180000000033\n"
OFF = dict.fromkeys((Stream.HEADING, Stream.GPS_POSITION, Stream.GPS_TIME), 0xFFFF)


@FIRMWARE
def test_a_held_button_keeps_the_estop_latched(firmware: str) -> None:
    """The driver does not release the e-stop while the board's e-stop button is held.

    The board itself would obey set-points with the button held.
    """
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


@pytest.mark.slow
@FIRMWARE
def test_a_release_without_a_press_latches_the_estop(firmware: str) -> None:
    """A reported release of the e-stop button latches the e-stop if its press was not reported.

    The board does not report a press during a record. Only the release shows the press.
    """
    bench = Bench(firmware)
    bench.drive_on(0.6, 1.0)
    bench.record(RecordKind.RPM, 50)
    while not told(bench, RecordComes):
        bench.drive(0.6)
        bench.run(TICK_S)
    bench.board.press(True)
    bench.run(2 * TICK_S)
    bench.presses(False)
    assert bench.session.estop_active
    assert any("its release was reported, but not its press" in text for text in bench.notices)
    bench.estop(False)
    assert not bench.session.estop_active


@pytest.mark.slow
def test_the_motion_monitor_names_this_boards_parameters() -> None:
    """The motion monitor's notices name parameters of the LOIS ECU.

    This board has no ~/start, so the advice is to latch and release the e-stop.
    """
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


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("seconds", [3.0, 1.2])
def test_a_reset_is_proved_by_counters_that_leap_to_zero(firmware: str, seconds: float) -> None:
    """The user resets the board after a drive. The tick counters jump to zero.

    The jump proves the reset, even after a drive of only 1.2 s.
    """
    bench = Bench(firmware)
    bench.drive_on(0.2, seconds)
    bench.run(3.0)
    ticks = bench.board.wheels[0].ticks
    assert ticks > 2
    done = bench.reset()
    assert (done.success, done.message) == (True, "the board was reset")
    assert [wheel.ticks for wheel in bench.board.wheels] == [0, 0]


def test_a_reset_that_was_given_up_before_it_was_sent_is_never_sent() -> None:
    """The driver gives up a reset before the reset reaches the line, and then writes Stop.

    The board receives no reset afterwards.
    """
    board = LoisEcuBoard(LoisEcuSettings())
    stream = board.actuator(StopProof())
    assert RESET in joined(board.reset())
    board.reset_given_up()
    stream.wrote(packed(encode_command(STOP)), 1.0)
    for tenths in range(11, 40):
        assert RESET not in joined(board.due(tenths / 10))


@FIRMWARE
def test_a_reset_that_nothing_can_show_says_so(firmware: str) -> None:
    """If the tick counters are already zero, the driver answers a reset as unconfirmed.

    Counters that stay zero do not show whether the board has obeyed.
    """
    bench = Bench(firmware)
    before = len(bench.written)
    done = bench.reset()
    assert done.success
    assert "unconfirmed" in done.message
    assert "0 and 0 ticks" in done.message
    sent = b"".join(data for _, data in bench.written[before:])
    assert sent.count(RESET) >= 2


@FIRMWARE
def test_a_reset_that_is_lost_is_not_counted_as_done(firmware: str) -> None:
    """The driver repeats a reset that was lost, until the tick counters prove it."""
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


@pytest.mark.slow
def test_a_reset_is_not_repeated_after_the_answer_that_it_failed() -> None:
    """A reset is lost. After the driver has reported the failure, it does not repeat the reset.

    When the line works again, a new request succeeds.
    """
    bench = Bench("documented")
    bench.drive_on(0.2, 1.2)
    bench.run(2.0)
    bench.hears = False
    bench.written.clear()
    assert not bench.reset().success
    assert 2 <= resets_in(bench) <= 8
    bench.written.clear()
    bench.run(2.0)
    assert resets_in(bench) == 0
    bench.hears = True
    assert bench.reset().message == "the board was reset"


def resets_in(bench: Bench) -> int:
    """Return how many resets the driver has written."""
    return b"".join(data for _, data in bench.written).count(b":18")


@pytest.mark.slow
@FIRMWARE
def test_a_reset_is_not_proved_by_the_counters_of_the_reset_before(firmware: str) -> None:
    """The counters are still zero after a first reset. A second reset is lost.

    Zero counters do not prove the second reset.
    """
    bench = Bench(firmware)
    bench.drive_on(0.2, 3.0)
    bench.run(2.0)
    assert bench.reset().message == "the board was reset"
    bench.run(3.0)
    bench.hears = False
    assert "unconfirmed" in bench.reset().message


@pytest.mark.slow
@FIRMWARE
def test_a_long_record_is_heard_while_it_comes(firmware: str) -> None:
    """For 1.2 s the board sends only a record. The state stays nominal, and the record is complete.

    The record has 1024 samples, one for each encoder tick. A wheel has 120 ticks per turn.
    """
    bench = Bench(firmware, LoisEcuSettings(ticks_per_revolution=120), steps=120)
    bench.drive_on(0.6, 2.0)
    bench.record(RecordKind.RPM, 1024)
    while not told(bench, RecordReading):
        bench.drive(0.6)
        bench.run(0.05)
        assert bench.session.state == "nominal"
    (reading,) = told(bench, RecordReading)
    assert len(reading.record.left) == len(reading.record.right) == 1024
    assert not [notice for notice in bench.notices if "checksums" in notice]


def test_a_long_record_is_not_taken_for_damage() -> None:
    """While the board sends the lines of a record, no notice about damage appears.

    These lines are valid, although they form no report.
    """
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
    """A board loses power while it sends a line. The notice says "no data", not "no valid data"."""
    bench = Bench("firmware")
    while not bench.board._uart.sending:
        bench.run(0.01)
    bench.lois.advance = lambda: []  # type: ignore[method-assign]
    bench.session.inbound.receive(b":1200", bench.now)
    bench.run(2.0)
    said = " ".join(str(event) for event in bench.events)
    assert "no data from the board" in said
    assert "no valid data" not in said


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 5, 12])
def test_every_setting_arrives_however_many_there_are(count: int) -> None:
    """Each setting arrives at least once, although the board does not receive while it sends.

    The driver writes all settings five times, each time in another order.
    """
    names = [setting for setting in Setting if setting != Setting.RPM_LOW_PASS][:count]
    quiet = {Stream.TICKS: 200, Stream.ODOMETRY: 200, **OFF}
    bench = Bench("firmware")
    written = dict.fromkeys(names, 0.5)
    configure(bench, LoisEcuSettings(periods_ms=quiet, written=written))
    bench.run(3.5)
    arrived = {line.command for line in bench.board.commands if line.payload == 0x3F000000}
    assert arrived == {int(setting) for setting in names}


@pytest.mark.slow
@FIRMWARE
def test_a_host_that_reads_late_gets_several_groups_at_once(firmware: str) -> None:
    """All reports of 0.6 s arrive in one read. Odometry stays within 0.15 m of the truth."""
    bench = Bench(firmware, HOST_GAINS)
    for _ in range(8):
        late: list[bytes] = []
        for step in range(60):
            bench.now += TICK_S
            late += [data for _, data in bench.robot.advance()]
            if step % 10 == 0:
                bench.drive(0.3)
        bench.session.inbound.receive(b"".join(late), bench.now)
        bench.session.tick(bench.now)
        bench.settle()
    bench.run(2.0)
    assert bench.odometry[-1].pose.x_m == pytest.approx(bench.robot.way_m, abs=0.15)


@FIRMWARE
def test_a_driver_that_leaves_says_nothing_but_stop(firmware: str) -> None:
    """The driver repeats its settings after a reconnection. Meanwhile, the shutdown begins.

    From then on, the driver sends only Stop, and no settings.
    """
    bench = Bench(firmware)
    bench.close()
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.drive_on(0.3, 0.3)
    bench.written.clear()
    bench.session.shutdown.begin(bench.now)
    bench.run(2.0)
    assert {data for _, data in bench.written} == {encode_command(SetDuty(0, 0))}


@pytest.mark.slow
@pytest.mark.parametrize("firmware", ["documented", "firmware"])
def test_a_reset_while_the_robot_drives_adds_no_way(firmware: str) -> None:
    """The board's counters are reset during a drive. The reset does not change the odometry."""
    bench = Bench(firmware)
    bench.drive_on(0.3, 4.0)
    before_m = bench.odometry[-1].pose.x_m - bench.robot.way_m
    bench.reset()
    bench.run(2.0)
    assert bench.odometry[-1].pose.x_m - bench.robot.way_m == pytest.approx(before_m, abs=0.06)


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("stall_s", [0.0, 1.3])
def test_counts_that_arrive_after_a_reset_move_no_odometry(firmware: str, stall_s: float) -> None:
    """A reset does not move the odometry if older tick counts arrive after the request.

    ``stall_s``: length in s of a stall just before the reset, in which the driver reads nothing.
    """
    bench = Bench(firmware, HOST_GAINS)
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    while bench.board.wheels[0].ticks < 4:
        bench.drive_on(0.2, 0.1)
    bench.run(3.0)
    assert all(8 <= wheel.ticks <= 18 for wheel in bench.board.wheels)
    sent = more = b""
    stalled_until = bench.now + stall_s
    while more or b":12ffffffff" not in sent or bench.now < stalled_until:
        bench.now += TICK_S
        more = b"".join(data for _, data in bench.robot.advance())
        sent += more
    before = bench.odometry[-1].pose
    bench.session.request(Request.RESET, "token", bench.now)
    bench.settle()
    bench.session.inbound.receive(sent, bench.now)
    bench.run(2.0)
    assert [wheel.ticks for wheel in bench.board.wheels] == [0, 0]
    assert before.way_to(bench.odometry[-1].pose).way_m < 0.02
    assert board._ecu.translation.counts.restarts == 0
    assert board._ecu.translation.odometry._motion.signed is (firmware == "documented")


def test_a_new_request_for_the_led_replaces_the_one_before() -> None:
    """The driver repeats each request for the LED several times, because it may be lost.

    The user switches the LED on, and soon afterwards off. The driver then repeats only "off".
    """
    bench = Bench("firmware")
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    begun = len(bench.written)
    for on in (True, False):
        board.set_led(on, bench.now)
        bench.run(0.05)
    bench.run(1.0)
    sent = b"".join(data for _, data in bench.written[begun:]).splitlines()
    led = [line[3:11] for line in sent if line.startswith(b":03")]
    assert led == [b"00000001", *[b"00000000"] * 5]


@FIRMWARE
@pytest.mark.slow
def test_a_robot_that_is_faster_than_it_can_be_is_stopped(firmware: str) -> None:
    """After four displacements in a row faster than ``fastest_linear_speed``, the robot is stopped.

    A single such displacement may come from a correction of the board's odometry.
    """
    bench = Bench(firmware)
    bench.session.configure(replace(SETTINGS, motion=MotionLimits(fastest_mps=0.6)), bench.now)
    bench.drive_on(0.2, 2.0)
    turns_per_s = 0.8 / (math.tau * 0.13)
    for motor in bench.board.motors:
        motor.advance = lambda _duty, dt_s: turns_per_s * dt_s
    with pytest.raises(CommandRefused, match="the motion monitor has stopped the robot"):
        bench.drive_on(0.2, 2.0)
    assert bench.session.figures(bench.now).commands.trips == 1
    assert [text for text in bench.notices if text.startswith("robot exceeds `fastest_linear")]
