# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The choice of the next request to the server: first a stop, then the command, then a query.

This module knows states, commands and measurements; it does not know where the commands come from.
The caller passes the time.
"""

import math
from typing import Final

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import EmergencyStop, GoTo
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.ground import (
    ESTOP_REPEAT_S,
    GREET_S,
    STARTS_UP_S,
)
from omnibot_driver.core.mart.hearing import Hearing
from omnibot_driver.core.mart.imu_proof import PROBE_S
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.required_motion import is_standstill, moving_order
from omnibot_driver.core.mart.states import (
    HALTS,
    LAST_HALTS,
    ROLLING,
    Motion,
    State,
)
from omnibot_driver.core.mart.stop_reasons import COASTS_S, HALF_STUCK, STUCK, STUCK_S
from omnibot_driver.core.mart.stopping import REPEAT_S
from omnibot_driver.core.mart.stops import LOST_REPEAT_S
from omnibot_driver.core.mart.words import Word
from omnibot_driver.core.packets import NO_PACKETS, Packets

STOPS_S: Final = 1.0
"""Time in s within which the server usually answers a stop."""
VOLTS_AFTER_S: Final = STARTS_UP_S - 0.1
"""Time in s between the server's first reply and the first query of the battery voltage (VOLTS).

VOLTS crashes a server that is starting up, but must precede the first motion.
"""
VOLTS_S: Final = 10.0
"""Longest time in s between two voltage queries (VOLTS), if unanswered requests delay the second
query. In the first STARTS_UP_S (s) after a motion, the time may be longer."""
SILENT_S, SILENT_AFTER_MOVE_S, GREET_AGAIN_S = 0.15, 0.05, 0.1
"""Times in s after which the driver sends the query HELLO to a silent server.

* ``SILENT_S``: time since the last reply, plus twice the average duration of a query.
* ``SILENT_AFTER_MOVE_S``: time since the last reply, if a duplicate of a move may be running.
* ``GREET_AGAIN_S``: shortest time between two of these queries.
"""
COMMANDED: Final = (
    "a motion command or a stop arrived during the request; stop sending commands, then call again"
)
ESTOPPED: Final = "the e-stop was latched during the request; release it, then call again"
COPY_S: Final = 0.25
"""Time in s after a controlled move within which the server must answer a query (ENC or HELLO).

Otherwise, the server may be executing a duplicate of the move.
"""


class Pilot(Hearing):
    """The pilot of one server. It decides which request is sent, and evaluates the replies."""

    def apply(self, wanted: Wanted, now: float) -> None:
        """Make ``wanted`` the motion, goal or stop that the robot must carry out from now on.

        A command or stop cancels the current job. But if a command repeats the present goal, the
        driver continues to read the angle of the last turn.
        """
        docks, move, order = self.jobs.moving, self._move, moving_order(wanted, now)
        if not (move and isinstance(order, GoTo) and order.place == move.place):
            move = None
        if wanted is not None and not (move and self.jobs.job is Job.TURN_RECORD):
            self.jobs.cancel(ESTOPPED if isinstance(wanted, EmergencyStop) else COMMANDED)
        if isinstance(wanted, EmergencyStop) and wanted is not self._wanted:
            self._stop_at_once(now)
        if wanted is not self._wanted:
            self._move = move.repeated() if move and not docks else None
            if is_standstill(self._wanted) or is_standstill(wanted):
                self._blocked = Motion.NONE
        self._wanted = wanted
        if is_standstill(wanted) and wanted is not None:
            self.proof.stopped(now)
            self._estop_said_s = now - ESTOP_REPEAT_S
        self._next_s = -math.inf

    @property
    def stop_words(self) -> tuple[Word, ...]:
        """The commands that stop the current motion."""
        if self.state in (State.LOST, State.ASKING):
            return LAST_HALTS[self.motion] or LAST_HALTS[Motion.UNKNOWN]
        if self.motion is Motion.NONE:
            release = (words.MSM,) if self._switch_off.underway else ()
            return HALTS[Motion.UNKNOWN] + release
        if self._stopping is not None and self._stopping.last_port:
            return LAST_HALTS[self.motion]
        return HALTS[self.motion]

    def busy(self, now: float) -> bool:
        """Return whether the driver expects the server to be silent, because the server is busy.

        If the server was silent for more than ``_absent_s`` before a stop, the server may be lost,
        and the result is False. In a controlled move, such silence is normal.
        """
        if (stopping := self._stopping) is not None:
            silent = stopping.move is None and stopping.began_s - self.heard_s > self._absent_s
            return self.greeted and not silent and now < stopping.began_s + STOPS_S
        if self.state is State.MOVING:
            return True
        answers = self.heard_s >= self.conversation.missed_s
        return answers and self.state in (State.SERVING, State.CHECKING, State.STARTING)

    @property
    def ready(self) -> bool:
        """Whether the server has answered the driver's first stop.

        The result is False if the server is lost, or if it is not a MART controller.
        """
        return self.greeted and not self.health.stranger and self.state is not State.LOST

    def fell_silent(self) -> None:
        """Begin a new connection after a long silence, because the server may have been restarted.

        Do nothing during a motion or a job, or if the stop port may hang (``Health.outlived``).
        """
        if self.state in (State.STILL, State.UNKNOWN) and not self.health.outlived:
            self.connect()

    @property
    def wake_at(self) -> float:
        """The time at which ``due`` must be called again."""
        return self._next_s

    def due(self, now: float) -> Packets:
        """Return the packets to send now."""
        self.now_s = now
        packets = self._due(now)
        self._next_s = self._wake(now)
        return packets

    def _wake(self, now: float) -> float:
        pending = self.conversation.pending
        if self.state is State.STOPPING:
            return self._stopping.wake_at if self._stopping is not None else now
        if self.state is State.LOST:
            return self._said_lost_s + LOST_REPEAT_S
        if self.state is State.ASKING:
            return self._ask_s if pending is None else pending.until_s
        if pending is not None:
            times = [pending.until_s, self.jobs.wake_at, self._copy_stop_s]
            times.append(self._greets_at)
            if self.state is State.MOVING:
                times.append(self._free_s)
            return min(times)
        if self.state is State.SERVING:
            return self.jobs.wake_at
        times = [max(self._polls.wake_at(self.state), now + 0.004), self._greets_at]
        if self.state is State.STILL and isinstance(self._wanted, EmergencyStop):
            times.append(max(now + 0.01, self._estop_said_s + ESTOP_REPEAT_S))
        if self.state is State.STILL and not is_standstill(self._wanted):
            times.append(max(now + 0.01, self._again_s, self._harmful_s + self._delay_s))
        return min(times)

    def _due(self, now: float) -> Packets:
        if self.began_s is None:
            self.began_s = now
        if (word := self.conversation.overdue(now)) is not None:
            self._missed(word, now)
        self.jobs.tick(now)
        busy = self.jobs.collecting or self.conversation.pending is not None
        if self.state is State.SERVING and not busy:
            self.state, self._served_s = State.STILL, now
        if self.state is State.UNKNOWN:
            self._halt(now)
        if self.state is State.STOPPING:
            return self._keep_stopping(now)
        if self.state is State.LOST:
            return self._repeat_lost(now)
        if self.state is State.ASKING:
            return self._keep_asking(now)
        if why := self._why_stop(now):
            if why is STUCK:
                self._learn_standing()
                self._doubt_the_left_wheel(STUCK_S)
            elif why is HALF_STUCK:
                self._blocked = Motion.REFERENCE
                self._doubt_the_left_wheel(COASTS_S)
            self._halt(now, "" if why == "wanted" else why)
            return self._keep_stopping(now)
        if now >= self._copy_stop_s:
            if self._copies_stopped_s < self._rested_s:
                self._first_copy_stop_s = now
            self._copies_stopped_s = now
            for form in self._last_move.word.forms if self._last_move is not None else ():
                self.conversation.owes(form, now + STOPS_S)  # the reply to the copy
            return self._send((words.SL, words.SS), now)
        if self.state is State.MOVING and now >= self._free_s:
            self._named_in_a_move(now)
            return self._keep_stopping(now)
        if now >= self._greets_at:
            self._greet_s = now + GREET_S
            return self._greet(now)
        if self.conversation.pending is not None:
            return NO_PACKETS
        return self._act(now) or self._poll(now)

    @property
    def _greets_at(self) -> float:
        """The time at which the driver must send HELLO to check that the server answers."""
        if self.state is State.MOVING:
            return self._greet_s
        if self.state is State.STARTING:
            return max(self._started_s + self._delay_s, self._greeted_s + GREET_AGAIN_S)
        if self.state in (State.STILL, State.CHECKING, *ROLLING):
            silent_s = SILENT_S + 2 * self.conversation.answered_trip_s
            if self.state is State.CHECKING:
                silent_s += PROBE_S[self.imu.word]
            elif self.state is State.STILL and self._suspects_copy:
                silent_s = SILENT_AFTER_MOVE_S
            return max(self.heard_s + silent_s, self._greeted_s + GREET_AGAIN_S)
        return math.inf

    @property
    def _suspects_copy(self) -> bool:
        """Whether the server may be executing a duplicate of the last controlled move.

        Two replies exclude a duplicate: an encoder count after the move, and the answer to a later
        HELLO. The answer must come at least twice the network delay after the move's start.
        """
        # the server would execute a duplicate before it answers
        counted = self.odometry.wheel.from_s >= self._rested_s
        return self._moved_last and not counted and not self._port_is_free

    @property
    def _copy_stop_s(self) -> float:
        """Time at which to stop a suspected duplicate of a move; infinity without one.

        The time is infinite in every state except STILL: in a drive, the stop commands SL and SS
        may hang the server.
        """
        if self.state is not State.STILL or not self._suspects_copy:
            return math.inf
        apart_s = self._halted_s + self._delay_s
        silent_s = COPY_S
        if self.odometry.wheel.told_s >= self._rested_s:  # maybe this count is a late reply
            silent_s += 2 * self._delay_s
        return max(self._rested_s + silent_s, self._copies_stopped_s + REPEAT_S, apart_s)

    def _may_ask_volts(self, now: float) -> bool:
        """Return whether the query of the battery voltage (VOLTS) may be sent now.

        VOLTS crashes a server that is starting up. So VOLTS waits after an unanswered request,
        because the server may have been restarted.
        """
        asked_s = self._polls.asked_s(words.VOLTS)
        longest_s = max(asked_s + VOLTS_S, self._rested_s + STARTS_UP_S)  # a turn asks for none
        quiet_s = min(self.conversation.missed_s + STARTS_UP_S, longest_s)
        return now >= max(self.appeared_s + VOLTS_AFTER_S, quiet_s)

    def _poll(self, now: float) -> Packets:
        due = self._polls.due(self.state, now)
        if self.state is State.STILL and self._suspects_copy:
            due.sort(key=lambda word: word is not words.ENC)
        elif self._may_run_on:
            due.sort(key=lambda word: word not in (words.RMRA, words.ENC))
        for word in due:
            if word is words.ENC and self._waits_for_heading():
                continue
            if word is words.VOLTS and not self._may_ask_volts(now):
                continue
            if self.conversation.may_ask(word, now):
                self._require(word)
                self._polls.asked(word, now)
                return self._ask(word.request(), now)
        return NO_PACKETS
