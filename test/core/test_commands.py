"""Pacing, repeating, timing out and the latch, with frames that mean nothing."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.commands import PACE_S, STOPPING_S, CommandSettings, CommandStream

STOP, ESTOP, GO, TURN = b"stop", b"estop", b"go", b"turn"


@pytest.fixture
def stream() -> CommandStream:
    return make_stream()


def make_stream() -> CommandStream:
    settings = CommandSettings(timeout_s=0.5, rate_hz=20.0)
    return CommandStream(settings, stop=STOP, emergency_stop=ESTOP)


def run(stream: CommandStream, start: float, end: float) -> list[tuple[float, bytes]]:
    """Serve the stream whenever it wants to be, as the pacer does."""
    written = []
    now = start
    while now <= end:
        frame = stream.due(now)
        if frame:
            written.append((now, frame))
        assert stream.wake_at > now, "the pacer would spin"
        now = stream.wake_at
    return written


def test_a_command_goes_out_at_once_when_the_line_has_rested(stream: CommandStream) -> None:
    """No timer stands between a command and the wire."""
    stream.command(GO, 1.0)
    assert stream.due(1.0) == GO


def test_within_the_pace_only_the_newest_command_goes_out(stream: CommandStream) -> None:
    """Commands closer together than a control tick would only fill the board's buffer."""
    stream.command(GO, 1.0)
    stream.due(1.0)
    stream.command(b"older", 1.002)
    assert stream.due(1.002) == b""
    stream.command(TURN, 1.004)
    assert stream.wake_at == pytest.approx(1.0 + PACE_S)
    assert stream.due(1.0 + PACE_S) == TURN


def test_the_current_command_is_repeated_at_the_command_rate(stream: CommandStream) -> None:
    """Nothing acknowledges a command, so it is said again."""
    stream.command(GO, 1.0)
    written = run(stream, 1.0, 1.449)
    assert [frame for _, frame in written] == [GO] * 9
    assert written[1][0] - written[0][0] == pytest.approx(0.05)


def test_after_the_timeout_stop_is_repeated_for_a_second_and_then_the_line_is_quiet(
    stream: CommandStream,
) -> None:
    """The board never stops by itself."""
    stream.command(GO, 1.0)
    written = run(stream, 1.0, 10.0)
    stops = [at for at, frame in written if frame == STOP]
    assert stops[0] == pytest.approx(1.5)
    assert stops[-1] - stops[0] == pytest.approx(STOPPING_S, abs=0.051)
    assert len(stops) == pytest.approx(20, abs=1)
    assert stream.wake_at == math.inf


def test_stop_never_waits(stream: CommandStream) -> None:
    """Not even for the pace of a command that has just gone out."""
    stream.command(GO, 1.0)
    stream.due(1.0)
    stream.command(STOP, 1.001)
    assert stream.due(1.001) == STOP


def test_a_flood_of_stops_keeps_the_pace(stream: CommandStream) -> None:
    """Once Stop is out, saying it a thousand times a second would only fill the line."""
    written = []
    for step in range(1000):
        now = 1.0 + step * 0.001
        stream.command(STOP, now)
        written.append(stream.due(now))
    assert 90 <= written.count(STOP) <= 101


def test_the_emergency_stop_never_waits_and_is_repeated_without_end(stream: CommandStream) -> None:
    """A latched stop is said for as long as it is latched."""
    stream.command(GO, 1.0)
    stream.due(1.0)
    stream.latch(1.001)
    assert stream.due(1.001) == ESTOP
    written = run(stream, 1.001, 101.0)
    assert {frame for _, frame in written} == {ESTOP}
    assert len(written) == pytest.approx(2000, abs=2)


def test_a_flood_of_emergency_stops_keeps_the_pace(stream: CommandStream) -> None:
    """A button node may publish as fast as it likes; the line has to take other things too."""
    written = []
    for step in range(1000):
        now = 1.0 + step * 0.001
        stream.latch(now)
        written.append(stream.due(now))
    assert 90 <= written.count(ESTOP) <= 101


def test_a_release_sends_stop_and_forgets_what_was_commanded_before(stream: CommandStream) -> None:
    """The robot moves again only on a command that is newer than the release."""
    stream.command(GO, 1.0)
    stream.due(1.0)
    stream.latch(1.1)
    stream.due(1.1)
    stream.release(1.2)
    assert {frame for _, frame in run(stream, 1.2, 5.0)} == {STOP}


def test_a_release_without_a_latch_does_nothing(stream: CommandStream) -> None:
    """Releasing twice must not stop a robot that drives again."""
    stream.command(GO, 1.0)
    stream.release(1.0)
    assert stream.due(1.0) == GO


def test_a_late_pacer_stops_instead_of_repeating_an_old_command(stream: CommandStream) -> None:
    """After the process stood still for long, what was commanded before is worth nothing."""
    stream.command(GO, 1.0)
    stream.due(1.0)
    assert stream.due(60.0) == STOP


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["command", "stop", "latch", "release", "discard", "wait"]),
        st.floats(0.0, 0.7),
    ),
    max_size=60,
)


@given(STEPS)
def test_whatever_happens_motion_is_fresh_paced_and_never_sent_while_latched(
    steps: list[tuple[str, float]],
) -> None:
    """The invariants of the outbound line under any sequence of events."""
    stream, now, commanded_at = make_stream(), 100.0, -math.inf
    written_at = -math.inf
    for step, pause in steps:
        if step == "command":
            stream.command(GO, now)
            commanded_at = now
        elif step == "stop":
            stream.command(STOP, now)
        elif step == "latch":
            stream.latch(now)
        elif step == "release":
            stream.release(now)
        elif step == "discard":
            stream.discard()
            commanded_at = -math.inf
        end = now + pause
        while True:
            frame = stream.due(now)
            if frame == GO:
                assert not stream.latched
                assert now - commanded_at < 0.5
                assert now - written_at >= PACE_S - 1e-9
            if stream.latched:
                assert frame in (b"", ESTOP)
            written_at = now if frame else written_at
            assert stream.wake_at > now
            if stream.wake_at > end:
                break
            now = stream.wake_at
        now = end
