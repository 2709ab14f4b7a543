# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the driver writes in a scene, which is a script of commands and requests.

The writes depend only on the states that the board reports. A ``Course`` has the writes for one
sequence of states, computed once for all trials with this sequence.
"""

from dataclasses import dataclass
from itertools import accumulate

from outbound_drive import History, Scene, Shown, rehearse
from outbound_words import parse

from omnibot_driver.simulator.omnibot.receivers import Command, CommandReceiver, ReceiverKind
from omnibot_driver.simulator.omnibot.wire import BYTE_S, ControlFrame


@dataclass(frozen=True, slots=True)
class Understood:
    """What a receiver understands of the driver's writes in a scene if no byte is damaged.

    ``held``: for each write, the bytes that the receiver still holds after the write.

    ``alike_until``: for each write, the index after its series of like writes. A series ends before
    a write that begins or ends a motion, waits for an earlier write, or is misunderstood.
    """

    held: list[bytes]
    alike_until: list[int]


class Course:
    """The driver's writes in a scene in which the board reports the states in ``history``."""

    def __init__(self, scene: Scene, history: History | None = None) -> None:
        self.scene = scene
        self.history: History = ((0, scene.begins),) if history is None else history
        self.writes = rehearse(scene, self.history)
        self.items = [parse(write.data) for write in self.writes]
        self.bytes_before = [0, *accumulate(len(write.data) for write in self.writes)]
        self.frames_before = [0, *accumulate(len(items.frames) for items in self.items)]
        self._others: dict[tuple[int, Shown], Course] = {}
        self._understood: dict[ReceiverKind, Understood] = {}

    def when(self, tick: int, shown: Shown) -> "Course":
        """Return the course in which the board reports ``shown`` from ``tick`` on.

        Before ``tick``, it equals this course. ``shown``: the mode of the board, and whether the
        robot moves.
        """
        other = self._others.get((tick, shown))
        if other is None:
            other = Course(self.scene, (*self.history, (tick, shown)))
            self._others[tick, shown] = other
        return other

    def understood(self, kind: ReceiverKind) -> Understood:
        """Return what a receiver of this kind, on a running board, understands of the writes."""
        if kind not in self._understood:
            self._understood[kind] = self._understand(kind)
        return self._understood[kind]

    @property
    def rehearsals(self) -> int:
        """Number of runs of the driver's session: one for this course and one for each variant.

        The method ``when`` makes the variants.
        """
        return 1 + sum(other.rehearsals for other in self._others.values())

    def _understand(self, kind: ReceiverKind) -> Understood:
        receiver = CommandReceiver(kind, awake=True)
        held, plain = [], []
        free_s = -1.0
        for write, items in zip(self.writes, self.items, strict=True):
            waits = write.at_s < free_s
            free_s = max(write.at_s, free_s) + len(write.data) * BYTE_S
            heard = [
                (at, command)
                for at, byte in enumerate(write.data)
                for command in receiver.feed(byte, write.at_s + at * BYTE_S, control_frames=True)
            ]
            held.append(receiver.held)
            says: list[tuple[int, Command]] = [
                (at, ControlFrame(mode, words)) for at, mode, words in items.frames
            ]
            # A write that waits for an earlier write on the line is unlike the writes before it.
            plain.append(heard == says and not waits)
        until = [len(self.writes)] * len(self.writes)
        for number in reversed(range(len(self.writes) - 1)):
            after = number + 1
            # A write that begins or ends a motion is unlike the writes before it, too.
            alike = plain[after] and self.items[after].moves == self.items[number].moves
            until[number] = until[after] if alike else after
        return Understood(held, until)
