# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the manual's state machine: the modes of a board, and which bytes it obeys in each."""

import pytest
from board_talk import (
    ESTOP,
    IMU,
    RUNNING,
    STOP,
    WAKE_UP,
    booted,
    deltas,
    mode_of,
    poses,
    run,
    velocity,
    wheels,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.simulator.omnibot import (
    BoardMode,
    BoardPose,
    BoardSettings,
    ReceivedCommand,
    ReceiverKind,
    SimulatedBoard,
)


def test_a_booting_board_is_dead_and_then_says_that_it_is_paused() -> None:
    """A booting board sends and obeys nothing. At the end of its boot it sends "Paused: 0"."""
    board = SimulatedBoard(BoardSettings(boot_time_s=0.3))
    board.receive(WAKE_UP + b"S")
    assert run(board, 0.29) == b""
    assert mode_of(board) is BoardMode.BOOTING
    assert board.step() == b"Paused: 0 \n"
    assert mode_of(board) is BoardMode.PAUSED


@pytest.mark.slow
def test_a_paused_board_counts_once_a_second() -> None:
    """A paused board sends a «Paused» text with a number once a second.

    The number grows by 1 with each text, up to 255. After that it is 0.
    """
    board = booted(BoardSettings())
    assert run(board, 2.0) == b"Paused: 1 \nPaused: 2 \n"
    assert run(board, 254.0).endswith(b"Paused: 255 \nPaused: 0 \n")


def test_a_board_that_was_not_woken_misses_three_bytes() -> None:
    """A board has booted and is not awake. It loses the first three bytes, even the letter S."""
    board = booted(BoardSettings())
    board.receive(b"SSS")
    assert mode_of(board) is BoardMode.PAUSED
    board.receive(b"S")
    assert mode_of(board) is BoardMode.NOMINAL


def test_a_board_may_wake_up_by_what_it_hears_while_it_boots() -> None:
    """Some boards can be woken during the boot, by the first three bytes that they receive.

    After the boot, such a board is awake, so it obeys the first S.
    """
    board = SimulatedBoard(BoardSettings(receiver=ReceiverKind(wakes_while_booting=True)))
    board.receive(bytes(3))
    run(board, 0.3)
    board.receive(b"S")
    assert mode_of(board) is BoardMode.NOMINAL


def test_p_pauses_and_unpauses() -> None:
    """The letter P pauses a board, and a second P starts it again.

    At the beginning of a pause, the board sends the text "Paused: 0".
    """
    board = SimulatedBoard(RUNNING)
    board.receive(b"P")
    assert mode_of(board) is BoardMode.PAUSED
    assert board.step() == b"Paused: 0 \n"
    board.receive(b"P")
    assert mode_of(board) is BoardMode.NOMINAL
    assert board.step().startswith(IMU)


def test_s_starts_a_paused_board_and_leaves_a_running_one_alone() -> None:
    """The letter S starts a paused board. It does not disturb the motion of a running one."""
    board = booted(BoardSettings())
    board.receive(WAKE_UP + b"SS" + velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(b"S")
    run(board, 1.0)
    assert mode_of(board) is BoardMode.NOMINAL
    assert board.truth.vx_mps == pytest.approx(0.5, rel=0.02)


def test_r_reboots_the_board_but_not_the_robot() -> None:
    """R reboots the board: odometry and sequence numbers become 0, but the true pose is unchanged.

    The host must wake the board again.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 2.0)
    board.receive(b"R" + velocity(35, 0, 0))
    assert mode_of(board) is BoardMode.BOOTING
    run(board, 1.0)
    at_rest = board.truth
    assert at_rest.x_m > 0.9
    assert at_rest.vx_mps == 0.0
    assert board.odometry == BoardPose(0.0, 0.0, 0.0)
    board.sent.clear()
    board.receive(WAKE_UP + b"S")
    run(board, 0.2)
    assert [seq for *_, seq in deltas(board)] == [0, 1, 2, 3, 4]
    assert poses(board) == [(0.0, 0.0, 0.0, 0)]
    assert board.truth == at_rest


def test_a_power_cycle_does_what_r_does() -> None:
    """A power cycle and the letter R have the same effect."""
    by_letter, by_power = SimulatedBoard(RUNNING), SimulatedBoard(RUNNING)
    by_letter.receive(b"R")
    by_power.reboot()
    assert run(by_letter, 3.0) == run(by_power, 3.0)
    assert mode_of(by_letter) is mode_of(by_power) is BoardMode.PAUSED


def test_a_motion_frame_to_a_paused_board_acts_by_its_letters() -> None:
    """A paused board reads the bytes of motion frames as letters: R resets it, and P resumes it."""
    board = booted(BoardSettings())
    board.receive(WAKE_UP + velocity(0x52, 0, 0))
    assert mode_of(board) is BoardMode.BOOTING
    run(board, 1.0)
    board.receive(WAKE_UP + velocity(0, 0x50, 0))
    assert mode_of(board) is BoardMode.NOMINAL
    run(board, 1.0)
    assert board.truth.vy_mps == 0.0


def test_a_motion_frame_to_a_sleeping_board_loses_its_header_to_the_wake_up() -> None:
    """The first three bytes of a frame wake a sleeping board; the next bytes act as letters."""
    board = booted(BoardSettings())
    board.receive(velocity(0x52, 0, 0))
    assert [command.kind for command in board.commands] == ["reset"]
    assert mode_of(board) is BoardMode.BOOTING


def test_a_board_that_takes_letters_anywhere_pauses_in_the_middle_of_a_frame() -> None:
    """A board that obeys state letters within frames gets a frame with two P (0x50).

    The first P pauses the board, and the second P starts it again.
    """
    board = SimulatedBoard(BoardSettings(running=True, receiver=ReceiverKind(letters="anywhere")))
    board.receive(wheels(0x50, 0, 0x50))
    assert [command.kind for command in board.commands] == ["pause", "pause"]
    assert mode_of(board) is BoardMode.NOMINAL


def test_a_running_board_takes_no_letters_out_of_frames() -> None:
    """A running board gets a frame that contains 0x50, 0x52 and 0x53.

    The board reads these bytes as numbers, not as letters.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(wheels(0x50, 0x52, 0x53))
    assert list(board.commands) == [ReceivedCommand(0, "wheels", (0x50, 0x52, 0x53))]
    assert mode_of(board) is BoardMode.NOMINAL


def test_an_unknown_control_mode_is_ignored() -> None:
    """A frame has an unknown control mode.

    The board ignores all of it. A byte 0x50 in it is not taken for the command letter P.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(bytes.fromhex("FF FE 03 00 50 00 50 00 50"))
    assert not board.commands
    assert mode_of(board) is BoardMode.NOMINAL


def test_a_board_that_knows_no_emergency_stop_drives_on() -> None:
    """A board without an emergency stop gets an emergency stop frame.

    The board ignores the frame and drives on.
    """
    board = SimulatedBoard(BoardSettings(running=True, obeys_estop=False))
    board.receive(velocity(35, 0, 0) + ESTOP)
    assert [command.kind for command in board.commands] == ["velocity"]
    assert board.driven
    assert not board.estopped


def test_a_pause_on_the_line_ends_half_a_frame_of_a_board_that_looks_for_it() -> None:
    """A receiver of the kind ``idle_gap`` discards an incomplete frame after a pause on the line.

    The board measures the pause by arrival times, or in ticks if the bytes have no arrival times.
    """
    kind = ReceiverKind(framing="idle_gap")
    timed, ticking = (SimulatedBoard(BoardSettings(running=True, receiver=kind)) for _ in range(2))
    timed.receive(STOP[:-1], 5.000)
    timed.receive(velocity(35, 0, 0), 5.006)
    ticking.receive(STOP[:-1])
    ticking.step()
    ticking.receive(velocity(35, 0, 0))
    assert [command.values for command in timed.commands] == [(35, 0, 0)]
    assert [command.values for command in ticking.commands] == [(35, 0, 0)]


def test_what_was_received_and_obeyed_is_on_record() -> None:
    """The board records all bytes received, and each command with its tick, kind and values."""
    board = SimulatedBoard(RUNNING)
    run(board, 0.05)
    data = velocity(1, -2, 3) + b"x" + STOP
    board.receive(data)
    assert board.received == data
    assert list(board.commands) == [
        ReceivedCommand(5, "velocity", (1, -2, 3)),
        ReceivedCommand(5, "wheels", (0, 0, 0)),
    ]


@pytest.mark.slow
def test_the_record_of_received_bytes_is_bounded() -> None:
    """The board receives more than a million bytes. Its record keeps about the newest million."""
    board = SimulatedBoard()
    for _ in range(12):
        board.receive(bytes(100_000))
    board.receive(b"end")
    assert len(board.received) < 1_100_000
    assert board.received.endswith(b"end")


command_bytes = st.lists(
    st.one_of(
        st.sampled_from([b"S", b"P", b"R", STOP, ESTOP, velocity(0x50, 0x52, 0x53)]),
        st.binary(max_size=12),
    ),
    max_size=12,
).map(b"".join)


@pytest.mark.slow
@given(command_bytes, st.data())
@settings(max_examples=60)
def test_the_chunking_of_the_input_does_not_matter(stream: bytes, data: st.DataObject) -> None:
    """The same bytes reach the board within one tick, in one chunk or in several chunks.

    The chunks have no effect on what the board does.
    """
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    whole, cut = SimulatedBoard(RUNNING), SimulatedBoard(RUNNING)
    whole.receive(stream)
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        cut.receive(stream[start:end])
    assert cut.commands == whole.commands
    assert cut.mode is whole.mode
    assert run(cut, 0.5) == run(whole, 0.5)
