# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the stream of set-points: pace, repetition, timeout. Any bytes serve as frames."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from set_point_bench import BOTH, GO, STOP, TIMEOUT_S, TURN, Stream, make_stream, order, run

from omnibot_driver.core.commands.policy import (
    STOPPING_S,
    UNPROVED_S,
    CommandSettings,
)
from omnibot_driver.core.commands.set_point_stream import MOTION_PACE_S, PACE_S
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.packets import packed


class Climbing:
    """A test motion: its first ``frames`` frames all differ, and then the last one repeats."""

    authority, is_zero = Authority.BASE, False

    def __init__(self, frames: int) -> None:
        self.left = frames

    @property
    def settled(self) -> bool:
        return not self.left

    def order(self, now: float) -> Any:
        self.left = max(0, self.left - 1)
        return GO + bytes([self.left])

    def check_anew(self) -> None:
        pass


@pytest.fixture
def stream() -> Stream:
    return make_stream()


def test_a_command_goes_out_at_once_when_the_line_has_rested(stream: Stream) -> None:
    """The driver has sent nothing for a while. It sends a new command at once."""
    order(stream, GO, 1.0)
    assert stream.write(1.0) == GO


def test_within_the_pace_only_the_newest_command_goes_out(stream: Stream) -> None:
    """Several commands arrive within 18 ms. The driver sends only the newest, to save bytes."""
    order(stream, GO, 1.0)
    stream.write(1.0)
    order(stream, b"older", 1.002)
    assert stream.write(1.002) == b""
    order(stream, TURN, 1.004)
    assert stream.wake_at == pytest.approx(1.0 + MOTION_PACE_S)
    assert stream.write(1.0 + MOTION_PACE_S) == TURN


def test_the_current_command_is_repeated_at_the_command_rate(stream: Stream) -> None:
    """The board acknowledges nothing, so the driver repeats each command."""
    order(stream, GO, 1.0)
    written = run(stream, 1.0, 1.449)
    assert [frame for _, frame in written] == [GO] * 9
    assert written[1][0] - written[0][0] == pytest.approx(0.05)


@pytest.mark.parametrize(("stands", "for_s"), [(True, STOPPING_S), (False, UNPROVED_S)])
@pytest.mark.parametrize("rate_hz", [1.0, 20.0])
def test_after_the_timeout_stop_is_repeated_until_the_robot_is_seen_to_stand(
    stream: Stream, stands: bool, for_s: float, rate_hz: float
) -> None:
    """After a command has expired, the driver sends Stop at 20 Hz, for 5 s.

    1 s is enough if the robot is proved to be at rest.
    """
    stream.configure(CommandSettings(timeout_s=TIMEOUT_S, rate_hz=rate_hz))
    order(stream, GO, 1.0)
    stops = [at for at, frame in run(stream, 1.0, 1.6) if frame == STOP]
    if stands:
        stream.proof.paused()
    stops += [at for at, frame in run(stream, 1.61, 10.0) if frame == STOP]
    assert stops[0] == pytest.approx(1.5)
    assert stops[-1] - stops[0] == pytest.approx(for_s, abs=0.051)
    assert stops[-1] - stops[0] > 0.999
    assert len(stops) == pytest.approx(20 * for_s, abs=1)
    assert stream.wake_at == math.inf
    assert stream.unconfirmed is not stands


def test_stop_never_waits(stream: Stream) -> None:
    """Stop is sent at once, even just after another command."""
    order(stream, GO, 1.0)
    stream.write(1.0)
    order(stream, STOP, 1.001)
    assert stream.write(1.001) == STOP


def test_a_repetition_does_not_make_a_new_command_wait(stream: Stream) -> None:
    """A new command is sent at once, also just after a repetition of the last command."""
    order(stream, GO, 1.0)
    stream.write(1.0)
    assert stream.write(1.05) == GO
    order(stream, TURN, 1.051)
    assert stream.write(1.051) == TURN


def test_a_zero_command_is_repeated_as_often_as_any_stop() -> None:
    """The command rate is 1 Hz.

    The driver repeats Stop faster, because a single Stop may be lost.
    """
    stream = Stream(CommandSettings(rate_hz=1.0))
    order(stream, STOP, 1.0)
    assert len(run(stream, 1.0, 1.49)) == pytest.approx(10, abs=1)


def test_a_letter_that_goes_out_while_driving_is_followed_by_the_command(
    stream: Stream,
) -> None:
    """During a drive, the driver sends a letter, such as S (start).

    The driver then repeats the command, because the zeros before the letter can turn a damaged
    frame into a wrong command.
    """
    order(stream, GO, 1.0)
    stream.write(1.0)
    stream.actuator.wrote(packed(b"S"), 1.02)
    assert stream.write(1.02) == GO


def test_a_flood_of_stops_keeps_the_pace(stream: Stream) -> None:
    """The user sends a thousand zero commands in a second.

    The driver sends about a hundred Stops.
    """
    written = []
    for step in range(1000):
        now = 1.0 + step * 0.001
        order(stream, STOP, now)
        written.append(stream.write(now))
    assert 90 <= written.count(STOP) <= 101


def test_a_motion_that_still_changes_goes_out_at_the_pace_of_new_ones(
    stream: Stream,
) -> None:
    """A motion whose frames differ, such as a ramp, is sent as one frame every 18 ms."""
    stream.command(Climbing(4), 1.0, expires_at=1.5)
    written = run(stream, 1.0, 1.1)
    assert [frame[-1] for _, frame in written] == [3, 2, 1, 0]
    assert [at for at, _ in written] == pytest.approx([1.0, 1.018, 1.036, 1.054])


def test_another_authority_is_stopped_before_the_newest_is_obeyed(stream: Stream) -> None:
    """A second topic begins to command the robot. The driver sends Stop at once.

    The new command follows 10 ms later.
    """
    order(stream, GO, 1.0)
    stream.write(1.0)
    order(stream, TURN, 1.001, Authority.WHEELS)
    assert run(stream, 1.001, 1.03) == [(1.001, STOP), (pytest.approx(1.011), TURN)]


def test_the_newest_of_three_authorities_wins_with_one_stop_before_it(
    stream: Stream,
) -> None:
    """Three topics command the robot within 2 ms.

    The driver sends the first command, one Stop, and the third command. It never sends the second.
    """
    order(stream, GO, 1.0)
    stream.write(1.0)
    order(stream, TURN, 1.001, Authority.WHEELS)
    order(stream, b"there", 1.002, Authority.POSE)
    assert run(stream, 1.002, 1.03) == [(1.002, STOP), (pytest.approx(1.012), b"there")]
    order(stream, TURN, 1.04, Authority.WHEELS)
    order(stream, b"there", 1.041, Authority.POSE)
    assert run(stream, 1.041, 1.055) == [(1.041, STOP), (pytest.approx(1.051), b"there")]


def test_an_authority_whose_command_has_expired_needs_no_stop_of_its_own(
    stream: Stream,
) -> None:
    """After a command has expired, another topic's command is sent without a second Stop."""
    order(stream, GO, 1.0)
    run(stream, 1.0, 1.6)
    order(stream, TURN, 1.62, Authority.WHEELS)
    assert run(stream, 1.62, 1.64)[0][1] == TURN


def test_a_stop_that_has_just_gone_out_is_the_one_between_two_authorities(
    stream: Stream,
) -> None:
    """The driver has just sent Stop when another topic begins to command the robot.

    It does not send a second Stop.
    """
    order(stream, GO, 1.0)
    stream.write(1.0)
    order(stream, STOP, 1.001)
    stream.write(1.001)
    order(stream, TURN, 1.002, Authority.WHEELS)
    assert run(stream, 1.002, 1.03) == [(pytest.approx(1.011), TURN)]


def test_what_is_discarded_leaves_the_line_quiet(stream: Stream) -> None:
    """After all commands are discarded, the driver writes nothing, not even a Stop that is due.

    The Stop is due because a motion was halted just before.
    """
    order(stream, GO, 1.0)
    stream.halt(1.0)
    stream.discard(1.0)
    assert stream.write(1.0) == b""
    assert stream.wake_at == math.inf


def test_a_late_pacer_stops_instead_of_repeating_an_old_command(stream: Stream) -> None:
    """The pacer, the thread that repeats commands, stalls for a minute while a command is active.

    After the stall, the pacer sends Stop, because the command has expired.
    """
    order(stream, GO, 1.0)
    stream.write(1.0)
    assert stream.write(60.0) == STOP


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["command", "wheels", "stop", "latch", "release", "discard", "wait"]),
        st.floats(0.0, 0.7),
    ),
    max_size=60,
)


@given(STEPS)
def test_whatever_happens_motion_is_fresh_paced_and_never_sent_while_latched(
    steps: list[tuple[str, float]],
) -> None:
    """In any order of commands, stops, e-stops and releases, only fresh commands are sent.

    While the e-stop is latched, no command is sent. Between the commands of two topics, a Stop is
    sent.
    """
    stream, now, commanded_at = make_stream(), 100.0, -math.inf
    fresh_at, fresh, driven = -math.inf, False, b""
    for step, pause in steps:
        if step == "command":
            order(stream, GO, now)
            commanded_at, fresh = now, True
        elif step == "wheels":
            order(stream, TURN, now, Authority.WHEELS)
            commanded_at, fresh = now, True
        elif step == "stop":
            order(stream, STOP, now)
        elif step == "latch":
            stream.latch(now)
        elif step == "release":
            stream.release(now)
        elif step == "discard":
            stream.discard(now)
            commanded_at, driven = -math.inf, b""
        end = now + pause
        while True:
            frame = stream.write(now)
            if frame in (GO, TURN):
                assert driven in (b"", frame), "no stop between two authorities"
                assert not stream.latched
                assert now - commanded_at < 0.5
                assert not fresh or now - fresh_at >= PACE_S - 1e-9
                fresh_at, fresh = (now, False) if fresh else (fresh_at, fresh)
            if stream.latched:
                assert frame in (b"", BOTH, 2 * BOTH)
            if frame:
                driven = frame if frame in (GO, TURN) else b""
            assert stream.wake_at > now
            if stream.wake_at > end:
                break
            now = stream.wake_at
        now = end
