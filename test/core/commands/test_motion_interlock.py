# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the motion interlock: when a robot that the motion monitor has stopped may move again.

The motion monitor stops a robot that does not move as commanded.
"""

from omnibot_driver.core.commands.motion_interlock import MotionInterlock, Until

TIMEOUT_S = 0.5


def arrives(interlock: MotionInterlock, now: float, *, stands: bool = False) -> bool:
    """Return whether a command that arrives at the time ``now`` is accepted.

    ``stands``: whether it is a zero command.
    """
    return not interlock.arrive(now, TIMEOUT_S, stands=stands)


def test_motion_is_allowed_until_something_trips() -> None:
    """All commands are accepted as long as the motion monitor has not stopped the robot."""
    interlock = MotionInterlock()
    assert all(arrives(interlock, 0.1 * step) for step in range(20))
    assert interlock.reason(2.0, TIMEOUT_S) == ""


def test_a_sender_that_goes_on_is_refused_for_as_long_as_it_goes_on() -> None:
    """After a stop by the motion monitor, commands are refused until they pause for the timeout."""
    interlock = MotionInterlock()
    arrives(interlock, 0.0)
    interlock.trip(0.1)
    assert not any(arrives(interlock, 0.1 + 0.49 * step) for step in range(1000))
    assert interlock.until is Until.RELEASE


def test_silence_for_the_timeout_ends_the_refusal() -> None:
    """After a stop by the motion monitor, a pause in the commands ends the refusal of motion.

    The pause must last for the command timeout, counted from the last command.
    """
    interlock = MotionInterlock()
    arrives(interlock, 0.0)
    interlock.trip(0.1)
    assert arrives(interlock, 0.5)


def test_a_zero_command_ends_the_refusal() -> None:
    """After a stop by the motion monitor, a zero command ends the refusal of motion.

    The zero command is accepted.
    """
    interlock = MotionInterlock()
    arrives(interlock, 0.0)
    interlock.trip(0.1)
    assert arrives(interlock, 0.2, stands=True)
    assert arrives(interlock, 0.21)


def test_after_the_second_trip_within_a_minute_only_start_helps() -> None:
    """The motion monitor stops the robot twice within a minute. Only ~/start allows motion again.

    Waiting does not help. Zero commands are accepted even before ~/start.
    """
    interlock = MotionInterlock()
    interlock.trip(0.0)
    arrives(interlock, 1.0, stands=True)
    interlock.trip(59.0)
    assert arrives(interlock, 60.0, stands=True)
    assert not arrives(interlock, 1000.0)
    interlock.trip(2000.0)
    assert interlock.until is Until.START
    interlock.start()
    assert arrives(interlock, 2000.1)


def test_after_a_minute_the_next_trip_is_a_first_one_again() -> None:
    """The motion monitor stops a robot at 0 s, at 61 s and, after a call of ~/start, at 62 s.

    None of these stops requires another call of ~/start: a minute or a call separates them.
    """
    interlock = MotionInterlock()
    for now in (0.0, 61.0):
        interlock.trip(now)
        assert interlock.until is Until.RELEASE
    interlock.start()
    interlock.trip(62.0)
    assert interlock.until is Until.RELEASE
    assert interlock.trips == 3


def test_on_a_board_without_start_the_release_of_the_estop_ends_the_refusal() -> None:
    """A board without ~/start is stopped by the motion monitor twice within a minute.

    Motion is refused until the user releases the e-stop after the second stop. A release between
    the two stops does not count.
    """
    interlock = MotionInterlock(starts=False)
    interlock.trip(0.0)
    interlock.release()
    assert interlock.until is Until.RELEASE
    interlock.trip(1.0)
    assert "latch and release the e-stop" in interlock.reason(2.0, TIMEOUT_S)
    assert not arrives(interlock, 100.0)
    interlock.release()
    assert arrives(interlock, 100.1)
