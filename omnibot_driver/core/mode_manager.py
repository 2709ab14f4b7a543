# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Requests for a mode of the board: start, pause and reset, repeated until data confirms them.

The letters S (start), P (pause) and R (reset) may be lost on the line. A second P would resume a
paused board, so the driver repeats P only if the board still sends data. Each request has a
deadline.

This module does not know bytes, and reads no clock.
"""

import math
from enum import Enum
from typing import Final

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.requests import Request, RequestDone

START_RETRY_S: Final = 0.5
PAUSE_RETRY_S: Final = 1.5
"""Time in s after which a command to pause or to reset is repeated if data still arrive.

A paused board sends a «Paused» text every second. If no such text arrives, the command was lost.
"""
FLOWING_S: Final = 0.1
"""Longest interval in s between two reads that counts in full as time with data.

A running board sends every 10 ms. Of a longer interval, only ``FLOWING_S`` counts, because the
board may have been silent.
"""
IN_FLIGHT_S: Final = 0.1
"""Longest time in s that a command takes to the board, or that a message takes to the driver.

A «Paused» text does not prove that a command was obeyed if the text comes within this time after
the command, or if data follow within this time.
"""
HELD: Final = (
    ", but the e-stop is latched: the robot does not move until you release it with ~/estop"
)
ANSWER_WITHIN_S: Final = 4.5
RESET_WITHIN_S: Final = 9.5


class Phase(Enum):
    """How far a change of the board's mode has progressed. Motion is accepted only in SETTLED."""

    CLOSED = "not connected"
    SETTLED = "settled"
    STARTING = "being started"
    PAUSING = "being paused"
    RESETTING = "being reset"


class Wanted(Enum):
    """The mode that the board should be in. A reconnect or a failed request does not change it."""

    ANY = "as it is"
    RUNNING = "running"
    PAUSED = "paused"


CLOSED: Final = Phase.CLOSED
SETTLED: Final = Phase.SETTLED
PAUSED: Final = Wanted.PAUSED
"""``CLOSED``, ``SETTLED``, ``PAUSED``: copies of Enum members, for the checks at every read.

They save time, because Python 3.11 looks up Enum members slowly.
"""


class ModeManager:
    """The manager of a board's mode: repeats start, pause or reset until the board has obeyed.

    * ``run``: whether to start the board at each connection. If False, the board keeps its mode.
    * ``answers``: answers to requests, until the reporter takes and clears them.
    """

    def __init__(self, board: Board, *, run: bool) -> None:
        self.phase = Phase.CLOSED
        self.answers: list[RequestDone] = []
        self._board = board
        self._wanted = self._wanted_before = Wanted.RUNNING if run else Wanted.ANY
        """``_wanted``: the mode that the board should be in.

        ``_wanted_before``: value of ``_wanted`` before the last request. If the board refuses a
        start, ``_wanted`` is set to this value again.
        """
        self.output: Packets = NO_PACKETS
        """Packets to write before any others; see ``take_output``."""
        self._said_at = self._data_at = -math.inf
        self._flowed_s = 0.0
        self._paused_with_p = self._was_running = self._may_have_restarted = False
        self._mode_known = False
        """Whether the board's mode was known when the last reset was sent.

        If the mode was unknown, a later pause does not prove a restart.
        """
        self._shown_at = math.inf
        self._request: Request | None = None
        self._token: object = None
        self._deadline = math.inf

    def take_output(self) -> Packets:
        """Return the packets to write before any others. From then on, they count as written."""
        packets, self.output = self.output, NO_PACKETS
        return packets

    @property
    def wake_at(self) -> float:
        """Time at which ``tick`` must be called, in s; infinity if never."""
        if self.phase is SETTLED:
            return self._deadline
        next_at = math.inf
        if self.phase is Phase.STARTING:
            next_at = self._said_at + START_RETRY_S
        elif self.phase is Phase.PAUSING:
            next_at = self._shown_at + IN_FLIGHT_S
        return min(next_at, self._deadline)

    def opened(self, now: float) -> None:
        """Wake the board after its port was opened, and start it if it should run.

        The bytes that wake the board also end a command that the board has received only in part.
        """
        self.output = NO_PACKETS
        self._begin(now)

    def closed(self, why: str) -> None:
        """Fail the request in progress, if any, because the port is lost or closed.

        ``why``: the reason, as the message of the answer.
        """
        self.phase = Phase.CLOSED
        self._answer(False, why)

    def request(self, request: Request, token: object, now: float) -> None:
        """Begin a request. Its answer appears in ``answers``.

        Raises RequestRefused at once if the request cannot begin. ``token`` identifies the request
        in the answer.
        """
        if self.phase is Phase.CLOSED:
            raise RequestRefused("the port is not open; connect the board, then call again")
        if self._request is not None:
            raise RequestRefused(
                f"a {self._request.value} is under way; wait for its answer, then call again"
            )
        if request is Request.RESET and (reason := self._board.reset_refusal):
            raise RequestRefused(f"reset refused: {reason}")
        self._request, self._token = request, token
        self._deadline = now + ANSWER_WITHIN_S
        self._wanted_before = self._wanted
        if request is Request.START:
            self._board.start_requested()
            if self.give_up_start():
                return
            self._wanted = Wanted.RUNNING
            if self._board.mode.running:
                self.phase = Phase.SETTLED
                self._say(self._board.start(), now)
            else:
                self._begin(now)
        elif request is Request.PAUSE:
            self._wanted = Wanted.PAUSED
            self._begin_pausing(now, with_p=False)
        else:
            self._was_running = self._board.mode.running
            if self._wanted is Wanted.ANY and self._was_running:
                self._wanted = Wanted.RUNNING
            self.phase = Phase.RESETTING
            self._deadline = now + RESET_WITHIN_S
            self._reset(now)

    def give_up_start(self) -> bool:
        """Fail the open ~/start request if the board refuses the start. Return whether it failed.

        If it failed, the wanted mode is again the one before the request.
        """
        refusal = self._board.start_refusal
        if self._request is not Request.START or self._board.mode.running or not refusal:
            return False
        self._wanted = self._wanted_before
        if self.phase is Phase.STARTING and self._wanted is not Wanted.RUNNING:
            self.phase = Phase.SETTLED
        self._answer(False, refusal)
        return True

    def heard_paused(self, now: float, *, continues: bool) -> None:
        """Record that the board has reported that it is paused.

        ``continues``: whether the board was already paused at its previous report, and has not
        restarted since then.
        """
        # the board may have sent the text before it received the command
        in_flight = now - self._said_at < IN_FLIGHT_S
        restarted = self._mode_known and not continues
        running_wanted = self._wanted is Wanted.RUNNING
        if self.phase is Phase.PAUSING:
            self._shown_at = now
        elif self.phase is Phase.RESETTING and in_flight:
            self._may_have_restarted |= restarted  # the next notice confirms the restart
        elif self.phase is Phase.RESETTING and not (restarted or self._may_have_restarted):
            self._reset(now)
        elif self.phase is Phase.RESETTING:
            if self._was_running:  # even after a pause that failed
                self._wanted = Wanted.RUNNING
            self._begin(now)
            if self._wanted is not Wanted.RUNNING:
                self._settle("the board has restarted and is paused, as before the restart")
        elif self.phase is Phase.STARTING or (self.phase is Phase.SETTLED and running_wanted):
            self._begin(now)  # the board has restarted, and may have missed earlier commands

    def heard_reset(self, now: float, remark: str = "") -> None:
        """Record that the board has obeyed a reset.

        ``remark``: a sentence that says what is not proved about the reset; empty if all is proved.
        A remark becomes the answer to the request.
        """
        if self.phase is Phase.RESETTING and now - self._said_at >= IN_FLIGHT_S:
            self.output += self._board.wake()
            self._settle(remark or "the board was reset")

    @property
    def at_rest(self) -> bool:
        """Whether the mode manager has nothing to do when a running board sends data.

        The value is True in the phase SETTLED, if no request is open and the wanted mode is not
        PAUSED.
        """
        return self.phase is SETTLED and self._request is None and self._wanted is not PAUSED

    def heard_data(self, now: float, *, estopped: bool) -> None:
        """Record that the board sends data and runs.

        ``estopped``: whether the driver's e-stop is latched. When a start or reset has made the
        board run, the answer mentions a latched e-stop.
        """
        data_at, self._data_at = self._data_at, now
        if self.at_rest:
            return
        self._flowed_s += min(now - data_at, FLOWING_S)
        self._shown_at = math.inf
        unheard = self._flowed_s >= PAUSE_RETRY_S
        running = f"running ({self._board.mode.value})" + (HELD if estopped else "")
        if self.phase is Phase.STARTING:
            self._settle(running)
        elif self.phase is Phase.SETTLED and self._request is Request.START:
            self._answer(True, running)
        elif self.phase is Phase.SETTLED and self._wanted is Wanted.PAUSED:
            self._begin_pausing(now, with_p=True)
        elif self.phase is Phase.PAUSING and (unheard or not self._paused_with_p):
            self._paused_with_p = True
            self._say(self._board.pause(), now)
        elif self.phase is Phase.RESETTING and unheard:
            self._reset(now)

    def heard_nothing(self, now: float) -> None:
        """Record that the board is silent: it may be rebooting, or disconnected."""
        if self.phase is Phase.SETTLED and self._wanted is Wanted.RUNNING:
            self._begin(now)

    def tick(self, now: float) -> None:
        """Confirm a pause, end an overdue request as failed, or send the start again if it is due.

        At most one of these is done.
        """
        if self.phase is Phase.PAUSING and now >= self._shown_at + IN_FLIGHT_S:
            self._settle("paused")
        elif now >= self._deadline:
            self._give_up(now)
        elif self.phase is Phase.STARTING and now - self._said_at >= START_RETRY_S:
            self._say(self._board.start(), now)

    def _begin(self, now: float) -> None:
        """Wake the board. Also start it if it should run and if it can be started."""
        self.output += self._board.wake()
        self.phase = Phase.SETTLED
        if self._wanted is Wanted.RUNNING and Request.START in self._board.traits.requests:
            self.phase = Phase.STARTING
            self._say(self._board.start(), now)

    def _begin_pausing(self, now: float, *, with_p: bool) -> None:
        """Begin to pause the board.

        ``with_p``: whether an earlier P may have been obeyed, or may still arrive. If True, the
        driver waits for ``PAUSE_RETRY_S`` before it sends P, because a second P would resume a
        paused board.
        """
        self.phase = Phase.PAUSING
        self._paused_with_p, self._shown_at = with_p, math.inf
        self._flowed_s = 0.0

    def _reset(self, now: float) -> None:
        self._mode_known = self._board.mode is not Mode.UNKNOWN
        self._say(self._board.reset(), now)

    def _say(self, packets: Packets, now: float) -> None:
        self.output += packets
        self._said_at, self._flowed_s, self._may_have_restarted = now, 0.0, False

    def _settle(self, message: str) -> None:
        self.phase = Phase.SETTLED
        self._answer(True, message)

    def _answer(self, success: bool, message: str) -> None:
        if self._request is not None:
            self.answers.append(RequestDone(self._token, success, message))
        self._request, self._token, self._deadline = None, None, math.inf

    def _give_up(self, now: float) -> None:
        mode = self._board.mode
        if mode is Mode.UNKNOWN:
            reason = f"no valid data from the board; check {self._board.traits.to_check}"
        elif mode is Mode.PAUSED:
            reason = (
                "the board still reports that it is paused; check that the cable carries data"
                " to the board"
            )
        else:
            reason = (
                "the board keeps sending data, so it has not obeyed the request; check that the"
                " cable carries data to the board"
            )
        if self.phase is Phase.RESETTING:
            self.phase = Phase.SETTLED
            self._board.reset_given_up()
            if self._wanted is Wanted.PAUSED:
                self._begin_pausing(now, with_p=True)
            elif self._wanted is Wanted.RUNNING and not mode.running:
                self._begin(now)
        if self.phase is Phase.STARTING:
            reason += " (the driver repeats the start until data arrives)"
        elif self.phase is Phase.PAUSING:
            reason += (
                " (the driver repeats the pause until the board is paused, and refuses motion"
                " until ~/start is called)"
            )
        self._answer(False, reason)
