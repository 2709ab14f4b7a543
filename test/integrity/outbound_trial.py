# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One outbound trial: a scene, a damaged line, a receiver, and the board behind the receiver.

A running board reports motion while the last set-point that arrived is a motion. It also reports
motion while the driver sends motion commands, even if they do not arrive. A change of state appears
in the reports after one or two ticks.
"""

import math
from bisect import bisect_right
from collections import deque
from copy import copy
from dataclasses import dataclass
from typing import Final

from outbound_course import Course
from outbound_judge import EXAMPLES, Judge, Score
from outbound_line import GOOD, Arrival, Line
from outbound_teller import TICK_S, Shown
from outbound_words import is_motion

from omnibot_driver.simulator.omnibot.receivers import (
    IDLE_GAP_S,
    CommandReceiver,
    ReceiverKind,
)
from omnibot_driver.simulator.omnibot.wire import BYTE_S, ControlFrame, ControlMode, StateLetter

BOOT_S: Final = 0.3
SHOWS_AFTER_S: Final = 0.01
MEMO: Final = 100_000

Made = tuple[bytes, list[tuple[int, ControlFrame]]] | None
Memo = dict[tuple[bytes, bool, bytes], Made]
"""Cached results of a receiver on a running board.

* Key: the bytes that the receiver held before, whether the line was idle, and the new bytes.
* Value: the bytes held afterwards, and the frames found, each with the position of its last byte.
* Value ``None``: the receiver found a letter, which may change the board's mode. So the new bytes
  must be processed one by one.
"""


@dataclass(frozen=True, slots=True)
class BoardKind:
    """How a board finds commands in the bytes, and whether it obeys an emergency stop."""

    receiver: ReceiverKind
    obeys_estop: bool = True


@dataclass(frozen=True, slots=True)
class Example:
    """An error in a trial, such as stray motion, and the driver's last writes before the error.

    ``writes``: for each write, its time in s, its bytes, and the bytes that reached the board.
    """

    scene: str
    board: BoardKind
    what: str
    writes: tuple[tuple[float, bytes, list[Arrival] | None], ...]

    def __str__(self) -> str:
        kind = self.board.receiver
        estop = "obeyed" if self.board.obeys_estop else "ignored"
        lines = [
            f"{self.scene} ({kind.framing}, letters {kind.letters}, e-stop {estop}): {self.what}"
        ]
        for at_s, data, arrivals in self.writes:
            came = "all" if arrivals is None else bytes(one[0] for one in arrivals).hex(" ")
            lines.append(f"    {at_s:.4f} s, sent {data.hex(' ')}; arrived {came}")
        return "\n".join(lines)


class Trial:
    """A trial of a scene on one kind of board.

    The constructor plays the scene until the line has faults; ``run`` plays the rest.

    ``memo``: cached results, which trials with the same kind of receiver may share.
    """

    def __init__(self, course: Course, board: BoardKind, memo: Memo) -> None:
        self._course, self._board, self._memo = course, board, memo
        self._line: Line = copy(GOOD)
        self._judge = Judge()
        self._shown = course.scene.begins
        self._mode = self._shown.mode
        self._receiver = CommandReceiver(board.receiver, awake=self._mode == "running")
        self._setpoint: ControlFrame | None = None
        self._driven = False
        self._driven_when_due: bool | None = None
        self._boots_at_s = self._shows_at_s = math.inf
        self._shows = self._shown
        self._last: deque[tuple[float, bytes, list[Arrival] | None]] = deque(maxlen=3)
        self._number = 0
        self._free_s = 0.0

        self._understood = course.understood(board.receiver)
        self._play(course.scene.faults_from_s)

    def run(self, line: Line, score: Score) -> None:
        """Play the rest of the scene on this line, and add the counts to the score."""
        trial = copy(self)
        trial._line, trial._judge = line, self._judge.branch(score)
        trial._receiver, trial._last = copy(self._receiver), self._last.copy()
        trial._play(math.inf)
        trial._end()

    def _play(self, until_s: float) -> None:
        scene = self._course.scene
        while True:
            writes = self._course.writes
            write_s = writes[self._number].at_s if self._number < len(writes) else math.inf
            event_s = min(self._shows_at_s, self._boots_at_s)
            if min(write_s, event_s) >= min(until_s, scene.ends_s):
                break
            if event_s > write_s:
                self._skip()
                self._write()
            elif event_s == self._shows_at_s:
                self._show()
            else:
                self._boot()

    def _end(self) -> None:
        scene = self._course.scene
        driven = self._driven if self._driven_when_due is None else self._driven_when_due
        if scene.still_by_s == math.inf:
            self._judge.end(scene.ends_s)
        elif self._judge.end(scene.ends_s, driven_when_due=driven, driven=self._driven):
            self._example("still driving")

    # The line

    def _skip(self) -> None:
        """Skip a series of writes that arrive undamaged and change nothing.

        The skipped writes count as arrived. The last write of the series goes over the line as
        usual.
        """
        course, receiver, begin = self._course, self._receiver, self._number
        before = begin - 1
        if (
            begin < 1
            or self._mode != "running"
            or self._shows_at_s < math.inf
            or not self._judge.calm
            or self._driven != course.items[before].moves
        ):
            return
        understood = self._understood
        if receiver.held != understood.held[before]:
            return
        reach = course.bytes_before[begin] + self._line.whole
        end = min(understood.alike_until[before], bisect_right(course.bytes_before, reach) - 1)
        last = end - 1
        if last <= begin:
            return
        self._line.whole -= course.bytes_before[last] - course.bytes_before[begin]
        self._judge.writes(
            course.items[last - 1], course.frames_before[last] - course.frames_before[begin]
        )
        write = course.writes[last - 1]
        receiver.held = understood.held[last - 1]
        receiver.last_at_s = write.at_s + len(write.data) * BYTE_S
        self._number = last

    def _write(self) -> None:
        """Send the bytes of the driver's next write over the line, and process what arrives."""
        course, number = self._course, self._number
        write, items = course.writes[number], course.items[number]
        self._number += 1
        start_s, data = max(write.at_s, self._free_s), write.data
        self._free_s = start_s + len(data) * BYTE_S
        drove = self._judge.driving
        self._judge.write(items, start_s)
        if self._judge.driving and not drove:
            self._changed(start_s)
        arrivals: list[Arrival] | None = None
        if self._line.whole >= len(data):
            self._line.whole -= len(data)
        else:
            arrivals = self._line.carry(data)
        self._last.append((start_s, data, arrivals))
        self._hear(data, arrivals, start_s)
        if drove and not self._judge.driving:
            self._changed(self._free_s)

    def _hear(self, data: bytes, arrivals: list[Arrival] | None, start_s: float) -> None:
        receiver = self._receiver
        no_gaps = arrivals is None or len(data) * BYTE_S < IDLE_GAP_S
        if self._mode == "running" and not receiver.to_swallow and no_gaps:
            came = data if arrivals is None else bytes([arrival[0] for arrival in arrivals])
            if not came:
                return
            first = 0 if arrivals is None else arrivals[0][1]
            paused = start_s + (first + 1) * BYTE_S - receiver.last_at_s >= IDLE_GAP_S
            key = (receiver.held, paused, came)
            made = self._memo[key] if key in self._memo else self._make_of(key)
            if made is not None:
                receiver.held, frames = made
                last = len(data) - 1 if arrivals is None else arrivals[-1][1]
                receiver.last_at_s = start_s + (last + 1) * BYTE_S
                for at, frame in frames:
                    place = at if arrivals is None else arrivals[at][1]
                    self._obey(frame, start_s + (place + 1) * BYTE_S)
                return
        for byte, place, origin in arrivals or [(byte, at, at) for at, byte in enumerate(data)]:
            self._take(byte, start_s + (place + 1) * BYTE_S, origin)

    def _make_of(self, key: tuple[bytes, bool, bytes]) -> Made:
        held, paused, came = key
        receiver = CommandReceiver(self._board.receiver, awake=True)
        receiver.held = held
        frames: list[tuple[int, ControlFrame]] = []
        made: Made = held, frames
        for at, byte in enumerate(came):
            for command in receiver.feed(byte, float(paused), control_frames=True):
                if isinstance(command, ControlFrame):
                    frames.append((at, command))
                else:
                    made = None
        if made is not None:
            made = receiver.held, frames
        if len(self._memo) >= MEMO:
            self._memo.clear()
        self._memo[key] = made
        return made

    def _take(self, byte: int, at_s: float, origin: int) -> None:
        if self._mode == "booting":
            if at_s < self._boots_at_s:
                self._receiver.boot()
                return
            self._boot()
        running = self._mode == "running"
        for command in self._receiver.feed(byte, at_s, control_frames=running):
            if isinstance(command, ControlFrame):
                self._obey(command, at_s)
            else:
                self._obey_letter(command, at_s, origin)

    # The board

    def _obey(self, frame: ControlFrame, at_s: float) -> None:
        estop = frame.mode == ControlMode.ESTOP
        if frame.mode not in (ControlMode.VELOCITY, ControlMode.WHEELS) and not (
            estop and self._board.obeys_estop
        ):
            return
        if wrong := self._judge.frame(frame, at_s):
            self._example(f"{wrong} {frame}")
        before, self._setpoint = self._setpoint, None if estop else frame
        if before != self._setpoint:
            self._changed(at_s)

    def _obey_letter(self, letter: StateLetter, at_s: float, origin: int) -> None:
        if wrong := self._judge.letter(letter, origin):
            self._example(f"{wrong} {letter.name}")
        if letter is StateLetter.RESET:
            self._mode, self._boots_at_s = "booting", at_s + BOOT_S
            self._receiver = CommandReceiver(self._board.receiver)
        elif self._mode == "paused":
            self._mode = "running"
        elif letter is StateLetter.PAUSE:
            self._mode = "paused"
        else:
            return
        self._setpoint = None
        self._judge.no_setpoint(at_s)
        self._changed(at_s)

    def _boot(self) -> None:
        at_s, self._boots_at_s = self._boots_at_s, math.inf
        self._mode = "paused"
        self._changed(at_s)

    def _changed(self, at_s: float) -> None:
        """Record that the visible state of the board may have changed."""
        if self._driven_when_due is None and at_s > self._course.scene.still_by_s:
            self._driven_when_due = self._driven
        if self._shows_at_s <= at_s:
            self._show()
        setpoint = self._setpoint
        self._driven = setpoint is not None and is_motion(setpoint.mode, setpoint.values)
        moves = self._judge.driving or (setpoint is not None and any(setpoint.values))
        shows = Shown(self._mode, moves and self._mode == "running")
        if shows == self._shown:
            self._shows_at_s = math.inf
        elif self._shows_at_s == math.inf or shows != self._shows:
            self._shows_at_s = math.ceil((at_s + SHOWS_AFTER_S) / TICK_S) * TICK_S
        self._shows = shows

    def _show(self) -> None:
        tick, self._shows_at_s = round(self._shows_at_s / TICK_S), math.inf
        self._shown = self._shows
        self._course = self._course.when(tick, self._shown)
        self._understood = self._course.understood(self._board.receiver)

    def _example(self, what: str) -> None:
        """Add the error ``what`` and the bytes that led to it to the score's examples.

        The score keeps only the first few examples.
        """
        examples = self._judge.score.examples
        if len(examples) < EXAMPLES:
            examples.append(Example(self._course.scene.kind, self._board, what, tuple(self._last)))
