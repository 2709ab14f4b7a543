# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of replays: every replay of a recorded line gives the same result, at any speed.

The session that ran during the recording had this result, too.
"""

import itertools
import math
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import pytest
from listener import Listener, link_to, session

from omnibot_driver.core.errors import LinkError, RequestRefused
from omnibot_driver.core.events import Event, Notice, StateChanged
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.packets import Packet
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.core.session import Session
from omnibot_driver.replay import Replay
from omnibot_driver.simulator.omnibot import BoardSettings, FaultyLine, LineFaults, SimulatedBoard

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

EPOCH_NS = 1_790_000_000_123_456_789
TICK_NS = 10_000_000
ENDED = Notice("the recording has ended; press ctrl-C to end the driver")

Chunks = list[tuple[int, bytes]]


@dataclass(frozen=True)
class Tape:
    """A recording that a test makes, in place of one from a bag."""

    content: Iterable[tuple[int, bytes]]
    speed: float = math.inf
    delay_s: float = 0.0

    def chunks(self) -> Iterator[tuple[int, Packet]]:
        for at_ns, data in self.content:
            yield at_ns, (0, data)


class Heard(Listener):
    """A listener that keeps the events of a replay, and each new state."""

    def __init__(self) -> None:
        super().__init__()
        self.session = session(obeys=False)
        self.states: list[str] = []
        self.epochs: set[int] = set()

    def take(self, events: Sequence[Event], epoch_ns: int) -> None:
        self.epochs.add(epoch_ns)
        self.states += [self.session.state for e in events if isinstance(e, StateChanged)]
        self.deliver(events)


def start(tape: Tape) -> tuple[Replay, Heard]:
    heard = Heard()
    replay = Replay(
        heard.session,
        tape,  # type: ignore[arg-type]
        deliver=heard.take,
        report=heard.report,
        failed=heard.failed,
    )
    replay.start()
    return replay, heard


def play(tape: Tape) -> Heard:
    replay, heard = start(tape)
    heard.wait_for(lambda: heard.failures or ENDED in heard.events)
    replay.close("stop")
    assert not heard.failures
    return heard


def simulated(ticks: int, *, silent: range = range(0), line: FaultyLine | None = None) -> Chunks:
    """Return the bytes of a moving board, with times, without the bytes of the ticks ``silent``."""
    board = SimulatedBoard(BoardSettings(seed=3, running=True))
    board.receive(bytes.fromhex("FF FE 01 00 0E 00 07 00 32"))
    found = []
    for tick in range(ticks):
        data = board.step()
        data = line.carry(data) if line else data
        jitter_ns = tick * 7_919_000 % 3_000_000
        if data and tick not in silent:
            found.append((EPOCH_NS + tick * TICK_NS + jitter_ns, data))
    return found


BAD_LINE = simulated(1500, line=FaultyLine(LineFaults(lose=0.003, burst=0.0003, flip=0.001)))


def measured(events: Iterable[Event]) -> list[tuple[object, ...]]:
    """Return the measurements without their stamps."""
    found: list[tuple[object, ...]] = []
    for event in events:
        if isinstance(event, ImuEstimate):
            found.append((event.specific_force, event.angular_velocity))
        elif isinstance(event, OdometryEstimate):
            found.append((event.pose, event.twist))
    return found


def test_a_replay_tells_what_was_told_when_it_was_recorded() -> None:
    """A replay has the same measurements as the recorded session, in the same order."""
    tape: Chunks = []
    listener, ours = Listener(), session()
    link = link_to(
        "sim://?seed=2",
        listener,
        ours,
        on_read=lambda packet: tape.append((time.monotonic_ns(), packet[1])),
    )
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.1, 0.4), now))
    listener.wait_for(lambda: len(listener.events) > 150)
    link.close("stop")
    live = measured(listener.events)
    assert len(live) > 100
    assert measured(play(Tape(tape)).events) == live


def test_every_replay_is_the_same() -> None:
    """Replays of a damaged line agree in measurements, stamps, states and warnings."""
    first, second = play(Tape(BAD_LINE)), play(Tape(BAD_LINE))
    assert len(measured(first.events)) > 1000
    assert any(isinstance(event, Notice) and event != ENDED for event in first.events)
    assert first.events == second.events
    assert first.states == second.states


def test_the_pace_makes_no_difference() -> None:
    """Replays of one recording at different playback speeds have the same events."""
    tape = Tape(BAD_LINE[:100])
    assert play(replace(tape, speed=5.0)).events == play(tape).events


def test_time_passes_as_it_did() -> None:
    """A silence of 2 s in a recording lasts 2 s in the replay, by recorded time.

    The state is ``connecting`` during the silence, and ``disconnected`` at the end.
    """
    heard = play(Tape(simulated(600, silent=range(200, 400))))
    assert heard.states == [
        *("connecting", "nominal"),
        *("connecting", "nominal"),
        "disconnected",
    ]
    assert heard.reports == [None]


@pytest.mark.parametrize("speed", [100.0, math.inf])
def test_a_step_of_the_recorders_clock_is_not_waited_for(speed: float) -> None:
    """The recorder's clock jumps ahead by 1000 days. The replay shortens this time to 10 s.

    A notice reports the pause. The stamps are those of the recording.
    """
    step_s = 1000 * 86_400
    drive = simulated(400)
    chunks = drive[:200] + [(at_ns + step_s * 10**9, data) for at_ns, data in drive[200:]]
    heard = play(Tape(chunks, speed=speed))
    said = [event.text for event in heard.events if isinstance(event, Notice)]
    assert "the recording has no data for 86400000 s here" in said[0]
    assert heard.states == ["connecting", "nominal", "connecting", "nominal", "disconnected"]
    stamps = [event.stamp_s for event in heard.events if isinstance(event, ImuEstimate)]
    before, after = stamps[0], stamps[-1]
    assert before == pytest.approx(0.0, abs=0.005)
    assert after == pytest.approx(step_s + 3.99, abs=0.01)
    assert all(stamp_s < 3.0 or stamp_s > step_s for stamp_s in stamps)
    assert stamps == sorted(stamps)


def test_a_recorded_robot_is_not_blamed_for_moving() -> None:
    """A recorded robot moves, but a replay has no commands.

    The driver must not warn of this motion.
    """
    heard = play(Tape(simulated(600)))
    assert [event for event in heard.events if isinstance(event, Notice)] == [ENDED]


def test_stamps_are_times_of_the_recording() -> None:
    """Stamps begin at the recorded time of the first bytes and continue with the board's ticks."""
    heard = play(Tape(simulated(300)))
    stamps = [event.stamp_s for event in heard.events if isinstance(event, ImuEstimate)]
    assert len(stamps) == 300
    assert heard.epochs == {EPOCH_NS}
    assert stamps[0] == pytest.approx(0.0, abs=0.005)
    assert stamps[-1] - stamps[100] == pytest.approx(1.99, abs=0.003)


def test_a_recording_can_be_left_before_its_end() -> None:
    """A replay is closed before it plays the first bytes, or in the middle of its recording.

    The close does not wait for the end of the recording.
    """
    for tape in (Tape(BAD_LINE, speed=1e-3), Tape(BAD_LINE, delay_s=3600.0)):
        replay, heard = start(tape)
        if tape.delay_s == 0.0:
            heard.wait_for(lambda heard=heard: heard.states)  # type: ignore[misc]
        replay.close("stop")
        replay.close("stop")
        assert ENDED not in heard.events
        assert not heard.failures


def test_commands_and_requests_go_nowhere_and_hang_nobody() -> None:
    """A request is pending when the recording ends. Its answer says that the port was lost.

    Later requests are refused, because the port is not open. The answer to an e-stop does not
    promise a stop.
    """
    endless = ((EPOCH_NS + n * TICK_NS, data) for n, (_, data) in enumerate(itertools.cycle(TAPE)))
    stop = threading.Event()
    tape = Tape(itertools.takewhile(lambda _: not stop.is_set(), endless), speed=1.0)
    replay, heard = start(tape)
    heard.wait_for(lambda: heard.session.state == "nominal")
    replay.command(Session.command_twist, BodyTwist(0.3, 0.0, 0.0), ())
    replay.call(lambda s, now: s.request(Request.PAUSE, "token", now))
    stop.set()
    heard.wait_for(lambda: ENDED in heard.events)
    assert "port was lost" in str([e for e in heard.events if getattr(e, "token", "") == "token"])
    with pytest.raises(RequestRefused, match="not open"):
        replay.call(lambda s, now: s.request(Request.START, "token", now))
    answer = replay.call(lambda s, now: s.estop(True, now))
    assert answer == "e-stop latched; a replay writes nothing to a board"
    replay.close("stop")
    assert not heard.failures


def test_a_request_is_answered_although_the_replay_is_closed() -> None:
    """A request is pending when the driver ends, in the middle of the recording.

    Its answer says that the driver is shutting down. The last state is disconnected.
    """
    replay, heard = start(Tape(BAD_LINE, speed=1.0))
    heard.wait_for(lambda: heard.session.state == "nominal")
    replay.call(lambda s, now: s.request(Request.PAUSE, "token", now))
    replay.close("stop")
    answers = [event for event in heard.events if isinstance(event, RequestDone)]
    assert [answer.token for answer in answers] == ["token"]
    assert "shutting down" in answers[0].message
    assert heard.states[-1] == "disconnected"
    assert not heard.failures


TAPE = simulated(100)


def test_a_recording_that_breaks_off_says_so() -> None:
    """A recording becomes unreadable.

    The replay ends with a notice, and all earlier events are valid.
    """

    def broken() -> Iterator[tuple[int, bytes]]:
        yield from TAPE
        raise LinkError("the recording x cannot be read any further: torn")

    replay, heard = start(Tape(broken()))
    heard.wait_for(lambda: heard.states[-1:] == ["disconnected"] and heard.events[-1] != ENDED)
    replay.close("stop")
    assert heard.events[-1] == Notice("the recording x cannot be read any further: torn")
    assert len(measured(heard.events)) > 100


def test_an_empty_recording_ends_at_once() -> None:
    """The replay of an empty recording publishes nothing and ends at once."""
    heard = play(Tape([]))
    assert heard.events == [ENDED]
    assert heard.reports == []
