# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A session against a simulated board in simulated time: what is promised, by the board's bytes."""

import itertools
import math

import pytest
from bench import EMERGENCY_STOP, OPENING, STOP, Bench

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import StateChanged
from omnibot_driver.core.inertial import ImuEstimate
from omnibot_driver.core.supervisor import Request, RequestDone
from omnibot_driver.simulator import BoardMode, BoardPose, BoardSettings


@pytest.fixture
def bench() -> Bench:
    """A started board that stands still, half a second after data began to flow."""
    bench = Bench()
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    return bench


def test_the_opening_sequence_is_zeros_stop_and_s_until_data_flows() -> None:
    """A board that boots swallows what it hears first; no command may be cut by that."""
    bench = Bench(BoardSettings(boot_time_s=2.0))
    bench.open()
    bench.run(1.25)
    assert bench.written_since(0) == OPENING + b"S" + b"S" + b"S"
    bench.run_until_state("nominal")
    assert [command.kind for command in bench.board.commands][:1] == ["start"]


def test_the_state_follows_what_is_heard_and_nothing_else() -> None:
    """Disconnected, connecting, paused, nominal: in the names the interface promises."""
    bench = Bench(run=False)
    assert bench.session.state == "disconnected"
    bench.open()
    assert bench.session.state == "connecting"
    bench.run_until_state("paused")
    bench.ask(Request.START, 5.0)
    assert bench.session.state == "nominal"
    bench.close()
    assert bench.session.state == "disconnected"


def test_without_auto_start_a_paused_board_stays_paused() -> None:
    """The opening then has no S."""
    bench = Bench(run=False)
    bench.open()
    bench.run(3.0)
    assert bench.session.state == "paused"
    assert bench.written_since(0) == OPENING


def test_imu_frames_without_deltas_are_imu_only_mode() -> None:
    """The board never says so itself."""
    bench = Bench(BoardSettings(imu_only=True))
    bench.open()
    bench.run_until_state("imu_only")
    assert any(isinstance(event, ImuEstimate) for event in bench.events)
    assert not bench.odometry


def test_garbage_is_not_an_understood_board() -> None:
    """The port is open and bytes flow, but the state goes on being ``connecting``."""
    bench = Bench()
    bench.speaks = False
    bench.open()
    for _ in range(300):
        bench.session.receive(b"\x00\x55\xff\x13" * 4, bench.now)
        bench.run(0.01)
    assert bench.session.state == "connecting"
    assert [text for text in bench.notices if "baudrate" in text] == bench.notices
    assert len(bench.notices) == 1


def test_a_silent_board_is_told_once() -> None:
    """And again only after it has been heard meanwhile."""
    bench = Bench()
    bench.speaks = False
    bench.open()
    bench.run(10.0)
    assert len([text for text in bench.notices if "power" in text]) == 1
    bench.speaks = True
    bench.run(2.0)
    bench.speaks = False
    bench.run(10.0)
    assert len([text for text in bench.notices if "power" in text]) == 2


def test_a_command_is_on_the_wire_before_the_call_returns(bench: Bench) -> None:
    """And it is the manual's frame: 0.3 m/s are 21 LSB, -0.2 m/s are -14, 0.5 rad/s are 250."""
    start = len(bench.written)
    bench.drive(0.3, -0.2, 0.5)
    assert bench.written_since(start) == bytes.fromhex("FF FE 01 00 15 FF F2 00 FA")


def test_wheel_commands_are_rim_speeds_on_the_wire(bench: Bench) -> None:
    """10 rad/s on a wheel of 29 mm are 0.29 m/s, 20.3 LSB; all scaled to the fastest."""
    start = len(bench.written)
    bench.session.command_wheels((10.0, -10.0, 0.0), bench.now)
    bench.settle()
    assert bench.written_since(start) == bytes.fromhex("FF FE 02 00 14 FF EC 00 00")
    bench.run(0.02)
    start = len(bench.written)
    bench.session.command_wheels((34.0, -17.0, 0.0), bench.now)
    bench.settle()
    assert bench.written_since(start) == bytes.fromhex("FF FE 02 00 23 FF EF 00 00")


def test_a_zero_twist_is_the_stop_frame_and_never_zeros_in_mode_one(bench: Bench) -> None:
    """With the switch on positional control those would mean: drive to the origin."""
    bench.drive(0.3)
    start = len(bench.written)
    bench.drive()
    assert bench.written_since(start) == STOP


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_counts_as_no_command(bench: Bench, bad: float) -> None:
    """It neither moves the robot nor keeps the last command alive."""
    bench.drive(0.3)
    bench.run(0.4)
    with pytest.raises(CommandRefused, match="not finite"):
        bench.drive(bad)
    with pytest.raises(CommandRefused, match="not finite"):
        bench.session.command_wheels((0.0, 1.0, bad), bench.now)
    bench.run(0.2)
    assert bench.written[-1][1] == STOP


@pytest.mark.parametrize("count", [0, 2, 4])
def test_a_wheel_command_has_exactly_three_values(bench: Bench, count: int) -> None:
    """Anything else is refused with the number that came."""
    start = len(bench.written)
    with pytest.raises(CommandRefused, match=f"{count} values"):
        bench.session.command_wheels([1.0] * count, bench.now)
    bench.settle()
    assert bench.written_since(start) == b""


def test_a_huge_command_is_limited_in_its_own_direction(bench: Bench) -> None:
    """1e300 m/s to the front left is 0.5 m/s to the front left: 24.7 LSB each."""
    start = len(bench.written)
    bench.drive(1e300, 1e300, -1e300)
    assert bench.written_since(start) == bytes.fromhex("FF FE 01 00 19 00 19 FF 06")


def test_the_robot_stands_still_after_the_timeout(bench: Bench) -> None:
    """Timeout, a second of Stop, then a quiet line."""
    bench.drive(0.5)
    bench.run(0.4)
    assert not bench.still()
    bench.run(1.5)
    assert bench.still()
    start = len(bench.written)
    bench.run(2.0)
    assert bench.written_since(start) == b""


@pytest.mark.parametrize("state", ["connecting", "paused"])
def test_motion_is_refused_unless_the_board_runs(state: str) -> None:
    """A paused board takes a 0x52 inside a motion command for R."""
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state(state)
    with pytest.raises(CommandRefused, match="~/start"):
        bench.drive(0.3)
    assert bench.written_since(0) == OPENING


def test_motion_is_refused_without_a_port() -> None:
    """And says so."""
    with pytest.raises(CommandRefused, match="not connected"):
        Bench().drive(0.3)


def test_pausing_sends_stop_then_one_p_and_is_confirmed_by_the_notice(bench: Bench) -> None:
    """Stop at once, P once data shows that the board runs."""
    bench.drive(0.5)
    bench.run(0.3)
    start = len(bench.written)
    answer = bench.ask(Request.PAUSE, 5.0)
    assert answer.success
    assert bench.board.mode is BoardMode.PAUSED
    assert bench.session.state == "paused"
    assert bench.written_since(start) == STOP + STOP + b"P"


def test_pausing_twice_does_not_toggle(bench: Bench) -> None:
    """The second time no P is sent, and the answer still rests on a new notice."""
    bench.ask(Request.PAUSE, 5.0)
    start, asked_at = len(bench.written), bench.now
    answer = bench.ask(Request.PAUSE, 5.0)
    assert answer.success
    assert bench.now > asked_at
    assert b"P" not in bench.written_since(start)
    assert bench.board.mode is BoardMode.PAUSED


def test_pausing_a_board_that_somebody_else_has_just_paused_does_not_unpause_it(
    bench: Bench,
) -> None:
    """The belief says nominal; only data that comes in after the request allows a P."""
    bench.board.receive(b"P")
    assert bench.session.state == "nominal"
    assert bench.ask(Request.PAUSE, 5.0).success
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_pausing_while_a_start_is_in_flight_ends_paused() -> None:
    """A notice sent before S was obeyed must not be taken for the answer."""
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state("paused")
    bench.run(0.985)
    bench.session.request(Request.START, object(), bench.now)
    bench.settle()
    bench.run(0.05)
    answer = bench.ask(Request.PAUSE, 5.0)
    bench.run(0.5)
    assert answer.success
    assert bench.board.mode is BoardMode.PAUSED


def test_a_lost_p_is_said_again(bench: Bench) -> None:
    """Data that flows for longer than the time between two notices shows that P was lost."""
    bench.hears = False
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    bench.settle()
    bench.run(0.5)
    bench.hears = True
    bench.run(2.0)
    assert RequestDone(token, True, "paused") in bench.events
    assert bench.board.mode is BoardMode.PAUSED


def test_a_board_that_does_not_hear_gets_no_false_confirmation(bench: Bench) -> None:
    """Cut in the direction to the board: pause, start and reset all say so in time."""
    bench.hears = False
    answer = bench.ask(Request.PAUSE, 5.0)
    assert not answer.success
    assert "cable" in answer.message
    answer = bench.ask(Request.RESET, 10.0)
    assert not answer.success


@pytest.mark.parametrize(
    ("request_", "limit_s"), [(Request.START, 5.0), (Request.PAUSE, 5.0), (Request.RESET, 10.0)]
)
def test_on_a_silent_board_every_request_is_answered_in_time(
    request_: Request, limit_s: float
) -> None:
    """With a sentence that says what to look at."""
    bench = Bench()
    bench.speaks = False
    bench.open()
    bench.run(2.0)
    answer = bench.ask(request_, limit_s)
    assert not answer.success
    assert "power" in answer.message


def test_one_request_is_under_way_at_a_time(bench: Bench) -> None:
    """The second is refused at once and told why."""
    bench.session.request(Request.RESET, object(), bench.now)
    with pytest.raises(RequestRefused, match="a reset is under way"):
        bench.session.request(Request.PAUSE, object(), bench.now)


def test_requests_without_a_port_are_refused() -> None:
    """At once, not after a timeout."""
    with pytest.raises(RequestRefused, match="port is not open"):
        Bench().session.request(Request.START, object(), 0.0)


def test_a_request_ends_with_the_port(bench: Bench) -> None:
    """Nobody waits for an answer that cannot come."""
    bench.session.request(Request.RESET, token := object(), bench.now)
    bench.close()
    answers = [event for event in bench.events if isinstance(event, RequestDone)]
    assert [(answer.token, answer.success) for answer in answers] == [(token, False)]


def test_starting_a_running_board_is_confirmed_and_changes_nothing(bench: Bench) -> None:
    """S is harmless while running; the current command goes on."""
    bench.drive(0.3)
    assert bench.ask(Request.START, 1.0).success
    bench.run(0.1)
    assert not bench.still()


def test_a_reset_brings_a_running_board_back_and_the_odometry_goes_on(bench: Bench) -> None:
    """Stop, R, the notice, the opening, data; the board counts from zero, odom does not."""
    for _ in range(20):
        bench.drive(0.5)
        bench.run(0.1)
    bench.run(1.0)
    before, start = bench.odometry[-1].pose, len(bench.written)
    answer = bench.ask(Request.RESET, 10.0)
    assert answer.success
    assert bench.written_since(start).startswith(STOP + b"R")
    assert bench.board.odometry.x_mm == pytest.approx(0.0, abs=0.5)
    bench.run(1.0)
    after = bench.odometry[-1].pose
    assert (after.x_m, after.y_m) == pytest.approx((before.x_m, before.y_m), abs=2e-3)
    assert bench.still()


def test_a_reset_of_a_paused_board_leaves_it_paused() -> None:
    """It comes back to what it was."""
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state("paused")
    bench.run(0.5)
    assert bench.ask(Request.RESET, 10.0).success
    bench.run(2.0)
    assert bench.board.mode is BoardMode.PAUSED
    assert [command.kind for command in bench.board.commands].count("reset") == 1


def test_a_paused_board_that_does_not_hear_r_is_not_said_to_have_restarted() -> None:
    """Its notices go on counting, as they did before."""
    bench = Bench(run=False)
    bench.open()
    bench.run(2.5)
    bench.hears = False
    answer = bench.ask(Request.RESET, 10.0)
    assert not answer.success
    assert "cable" in answer.message


def test_a_board_that_restarts_is_started_again_and_stands_still(bench: Bench) -> None:
    """Brown-out while driving: what was commanded before the restart is not sent after it."""
    bench.drive(0.5)
    bench.run(0.2)
    bench.board.reboot()
    bench.run_until_state("paused")
    noticed = len(bench.written) - 1
    bench.run_until_state("nominal")
    bench.run(1.0)
    assert bench.still()
    assert bench.written_since(noticed).startswith(OPENING + b"S")
    assert b"\xff\xfe\x01" not in bench.written_since(noticed)
    bench.drive(0.3)
    bench.run(0.3)
    assert not bench.still()


def test_a_robot_that_is_not_heard_is_driven_no_further_and_shows_connecting(bench: Bench) -> None:
    """Only the direction from the board is cut: it still hears us, so it is told to stop."""
    bench.drive(0.5)
    bench.run(0.1)
    bench.speaks = False
    bench.run(0.25)
    bench.drive(0.5)
    bench.run(0.06)
    assert bench.written[-1][1] == STOP
    with pytest.raises(CommandRefused, match="nothing was heard"):
        bench.drive(0.5)
    bench.run(0.4)
    assert bench.still()
    assert bench.session.state == "nominal"
    bench.run(1.0)
    assert bench.session.state == "connecting"
    bench.speaks = True
    bench.run_until_state("nominal")
    bench.run(1.0)
    assert bench.still()


def test_stop_is_sent_also_to_a_board_that_is_not_heard(bench: Bench) -> None:
    """It may hear us."""
    bench.speaks = False
    bench.run(1.45)
    start = len(bench.written)
    bench.drive()
    assert bench.written_since(start) == STOP


def test_after_a_cut_in_both_directions_the_robot_is_stopped_before_anything_else(
    bench: Bench,
) -> None:
    """The board drove on with its last command; it must not when it is heard again."""
    bench.drive(0.5)
    bench.run(0.1)
    bench.speaks = bench.hears = False
    bench.run(5.0)
    assert not bench.still()
    bench.speaks = bench.hears = True
    bench.run(1.0)
    assert bench.still()


def test_a_reconnected_port_stands_still_until_a_new_command(bench: Bench) -> None:
    """What was current when the port was lost is not sent on the new one."""
    bench.drive(0.5)
    bench.run(0.1)
    bench.close()
    bench.open()
    bench.run(1.0)
    assert bench.session.state == "nominal"
    assert bench.still()


def test_a_paused_robot_is_still_paused_after_a_reconnect(bench: Bench) -> None:
    """The wanted mode outlives the port."""
    bench.ask(Request.PAUSE, 5.0)
    bench.close()
    bench.open()
    bench.run(3.0)
    assert bench.session.state == "paused"


def test_the_estop_is_out_at_once_and_refuses_commands(bench: Bench) -> None:
    """Motion stops, and nothing but the manual's E-stop is sent while it is latched."""
    bench.drive(0.5)
    bench.run(0.1)
    start = len(bench.written)
    assert "latched" in bench.session.estop(True, bench.now)
    bench.settle()
    assert bench.written_since(start) == EMERGENCY_STOP
    with pytest.raises(CommandRefused, match="~/estop"):
        bench.drive(0.5)
    bench.run(5.0)
    assert {data for _, data in bench.written[start:]} == {EMERGENCY_STOP}
    assert bench.still()
    assert StateChanged() in bench.events


def test_the_estop_survives_reconnect_restart_start_and_reset(bench: Bench) -> None:
    """Only a release ends it, and then the robot stands until a newer command."""
    bench.session.estop(True, bench.now)
    bench.settle()
    bench.close()
    bench.open()
    bench.run(1.0)
    bench.board.reboot()
    bench.run(3.0)
    bench.ask(Request.START, 5.0)
    bench.ask(Request.RESET, 10.0)
    assert bench.session.estop_active
    bench.run(1.0)
    assert bench.written[-1][1] == EMERGENCY_STOP
    assert "released" in bench.session.estop(False, bench.now)
    bench.settle()
    bench.run(2.0)
    assert bench.still()
    bench.drive(0.3)
    bench.run(0.3)
    assert not bench.still()


def test_an_estop_without_a_port_is_sent_as_soon_as_there_is_one() -> None:
    """Right behind the opening, before the robot can do anything."""
    bench = Bench()
    assert "not open" in bench.session.estop(True, bench.now)
    bench.settle()
    bench.open()
    assert bench.written_since(0) == OPENING + b"S" + EMERGENCY_STOP


@pytest.mark.parametrize(
    ("on_exit", "expected"), [("stop", STOP), ("pause", STOP + b"P"), ("reset", STOP + b"R")]
)
def test_the_farewell_stops_the_robot_whatever_else_it_does(
    bench: Bench, on_exit: str, expected: bytes
) -> None:
    """Stop comes first."""
    assert bench.session.farewell(on_exit) == expected


def test_a_farewell_to_a_paused_board_does_not_unpause_it() -> None:
    """P is a toggle."""
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state("paused")
    assert bench.session.farewell("pause") == STOP


def test_a_farewell_while_a_pause_is_in_flight_still_ends_paused(bench: Bench) -> None:
    """P has been said and not yet shown: a second one alone would undo it."""
    bench.session.request(Request.PAUSE, object(), bench.now)
    bench.settle()
    bench.speaks = False
    while b"P" not in bench.written_since(0):
        bench.speaks = True
        bench.run(0.01)
        bench.speaks = False
    bench.board.receive(bench.session.farewell("pause"))
    bench.hears = False
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_farewell_while_a_start_is_in_flight_ends_paused() -> None:
    """The notice is still believed, but S is on its way."""
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state("paused")
    bench.session.request(Request.START, object(), bench.now)
    bench.settle()
    bench.board.receive(bench.session.farewell("pause"))
    bench.hears = False
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_farewell_under_estop_repeats_the_estop(bench: Bench) -> None:
    """The last thing the board hears is that it must not move."""
    bench.session.estop(True, bench.now)
    assert bench.session.farewell("stop") == STOP + EMERGENCY_STOP


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_attaching_to_a_board_that_has_driven_does_not_rotate_the_odometry(frame: str) -> None:
    """Its heading is a quarter turn; forward is still forward, and begins at the identity."""
    bench = Bench(
        BoardSettings(frame=frame, initial_pose=BoardPose(1000.0, -500.0, 1571.0), running=True)
    )
    bench.open()
    bench.run(1.0)
    for _ in range(20):
        bench.drive(0.5)
        bench.run(0.1)
    bench.run(1.0)
    pose = bench.odometry[-1].pose
    truth = bench.board.truth
    assert bench.odometry[0].pose.x_m == pytest.approx(0.0, abs=1e-4)
    assert math.hypot(truth.x_m, truth.y_m) > 0.9
    assert pose.x_m == pytest.approx(math.hypot(truth.x_m, truth.y_m), abs=2e-3)
    assert pose.y_m == pytest.approx(0.0, abs=2e-3)


def test_imu_estimates_come_every_tick_and_in_si_units(bench: Bench) -> None:
    """Upside down and at rest: minus one g on z. One may have been in doubt before."""
    start = bench.now
    bench.run(1.0)
    imu = [
        event for event in bench.events if isinstance(event, ImuEstimate) and event.stamp_s > start
    ]
    assert 98 <= len(imu) <= 101
    mean = sum(estimate.specific_force[2] for estimate in imu) / len(imu)
    assert mean == pytest.approx(-9.8, abs=0.1)


def test_odometry_has_the_stamps_of_its_own_ticks_samples(bench: Bench) -> None:
    """Also the displacements that waited for the first pose."""
    stamps = {event.stamp_s for event in bench.events if isinstance(event, ImuEstimate)}
    assert len(bench.odometry) > 30
    assert {estimate.stamp_s for estimate in bench.odometry} <= stamps


def test_stamps_go_forward_over_a_restart_and_a_reconnect(bench: Bench) -> None:
    """And after both, a tick is 10 ms again."""
    bench.board.reboot()
    bench.run_until_state("paused")
    bench.run_until_state("nominal")
    bench.run(1.0)
    bench.close()
    bench.run(0.5)
    bench.open()
    bench.run(1.0)
    stamps = [event.stamp_s for event in bench.events if isinstance(event, ImuEstimate)]
    assert all(before < after for before, after in itertools.pairwise(stamps))
    assert stamps[-1] <= bench.now
    ends = zip(stamps[-50:], stamps[-49:], strict=False)
    assert all(after - before == pytest.approx(0.01, abs=1e-6) for before, after in ends)


def test_reset_odometry_zeroes_the_pose_and_the_way_goes_on_from_there(bench: Bench) -> None:
    """Half-way through a straight line."""
    for _ in range(10):
        bench.drive(0.5)
        bench.run(0.1)
    way_before = bench.board.truth.x_m
    bench.session.reset_odometry(bench.now)
    for _ in range(10):
        bench.drive(0.5)
        bench.run(0.1)
    bench.run(1.0)
    way = bench.board.truth.x_m - way_before
    unreported = 0.04 * 0.5
    assert bench.odometry[-1].pose.x_m == pytest.approx(way, abs=unreported)


def test_lost_odometry_frames_are_told_once_in_a_while_and_counted(bench: Bench) -> None:
    """A hundred lost frames are not a hundred lines."""
    for _ in range(30):
        bench.speaks = False
        bench.run(0.08)
        bench.speaks = True
        bench.run(0.4)
    losses = [text for text in bench.notices if "lost" in text]
    assert 1 <= len(losses) <= 2


def test_motion_during_a_pause_moves_the_pose_and_is_no_speed(bench: Bench) -> None:
    """The robot rolled to a halt while nobody was told; afterwards it stands."""
    bench.drive(0.5)
    bench.run(0.4)
    bench.ask(Request.PAUSE, 5.0)
    count = len(bench.odometry)
    bench.run(1.0)
    bench.ask(Request.START, 5.0)
    bench.run(1.0)
    after = bench.odometry[count:]
    assert after[0].twist is None
    assert all(abs(item.twist.vx_mps) < 0.01 for item in after[1:] if item.twist)
    assert after[-1].pose.x_m == pytest.approx(bench.board.truth.x_m, abs=2e-3)


@pytest.mark.parametrize("signs", list(itertools.product([1, -1], repeat=3)))
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_with_any_axis_signs_the_odometry_shows_what_was_commanded(
    signs: tuple[int, int, int], frame: str
) -> None:
    """A curve to the left, on a board whose own heading is something else."""
    bench = Bench(
        BoardSettings(frame=frame, initial_pose=BoardPose(0.0, 0.0, 2000.0), running=True),
        axis_signs=signs,
    )
    bench.open()
    bench.run(1.0)
    for _ in range(20):
        bench.drive(0.3, 0.1, 0.5)
        bench.run(0.1)
    pose, twist = bench.odometry[-1].pose, bench.odometry[-1].twist
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((0.37, 0.43, 0.95), abs=0.06)
    assert (twist.vx_mps, twist.vy_mps) == pytest.approx((0.3, 0.1), abs=0.03)
    assert bench.written[-1][1][3] == (0 if signs[0] > 0 else 0xFF)


def test_a_robot_that_drove_on_unheard_is_where_it_is_once_it_is_heard_again() -> None:
    """The cable is out for three seconds while the board carries out its last command."""
    bench = Bench(BoardSettings(initial_pose=BoardPose(4000.0, 0.0, 1571.0), running=True))
    bench.open()
    bench.run(1.0)
    bench.drive(0.3, 0.0, 0.4)
    bench.run(0.3)
    bench.speaks = bench.hears = False
    bench.close()
    bench.run(3.0)
    bench.speaks = bench.hears = True
    bench.open()
    bench.run(2.0)
    truth, pose = bench.board.truth, bench.odometry[-1].pose
    assert math.hypot(truth.x_m, truth.y_m) > 0.7
    assert math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m) < 0.005
    assert pose.yaw_rad == pytest.approx(truth.yaw_rad, abs=0.005)


def test_a_driver_that_stood_still_has_no_command_and_blames_nobody(bench: Bench) -> None:
    """What was current is not repeated; the silence was its own."""
    bench.drive(vx=0.3)
    bench.run(0.2)
    mark = len(bench.written)
    bench.now += 3.0
    bench.session.stood_still(3.0, bench.now)
    bench.session.tick(bench.now)
    bench.settle()
    bench.run(2.0)
    assert {data for _, data in bench.written[mark:]} == {STOP}
    assert bench.still()
    assert bench.notices == [
        "the driver stood still for 3.0 s: the robot is stopped until a new command comes"
    ]
    bench.drive(vx=0.3)
    assert bench.board.commands[-1].kind == "velocity"
