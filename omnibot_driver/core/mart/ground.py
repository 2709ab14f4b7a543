# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The base class of ``Pilot``: it stores the state of server and robot, and sends commands.

This module knows states and commands; it does not know why a command is sent. The caller passes the
time.
"""

import math
from typing import Final

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import Conversation
from omnibot_driver.core.mart.goal import Move, Surplus
from omnibot_driver.core.mart.health import Health
from omnibot_driver.core.mart.imu_proof import PROBE_S, ImuProof
from omnibot_driver.core.mart.jobs import Jobs
from omnibot_driver.core.mart.odometry import MartOdometry
from omnibot_driver.core.mart.polls import Polls
from omnibot_driver.core.mart.replies import MartDecoder
from omnibot_driver.core.mart.required_motion import STANDING
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.speed_loop import SpeedLoop
from omnibot_driver.core.mart.spot_turns import SpotTurns
from omnibot_driver.core.mart.states import (
    HARMFUL_LATE,
    ROLLING,
    Motion,
    State,
    may_say,
)
from omnibot_driver.core.mart.stopping import Stopping
from omnibot_driver.core.mart.switch_off import SwitchOff
from omnibot_driver.core.mart.turn_record import TurnRecords
from omnibot_driver.core.mart.words import Request, Word
from omnibot_driver.core.packets import Packets
from omnibot_driver.core.readings import ExtraReading, NoticeReading, OdometryReading, Reading

STARTS_UP_S: Final = 1.5
"""Shortest time in s from the server's first reply after an absence to the start of a motion. An
earlier VOLTS or motion can crash the server; after a crash by RM (forward drive), the motors stay
on."""
ABSENT_S, ABSENT_TRIPS = 0.5, 3
"""Limit for a silence of the server. After a longer silence, the server is regarded as absent.

The limit in s is ABSENT_S plus ABSENT_TRIPS times the average duration of a query.
"""
MOST_GREETINGS: Final = 10
"""Largest number of unanswered HELLO queries for which the driver still expects answers. If more
queries are unanswered, it expects answers to the newest MOST_GREETINGS queries only."""
HEADING_S, HEADING_TRIPS = 1.0, 5
NO_HEADING: Final = (
    "the server does not report the relative heading (RMRA) of the robot at rest, so the heading of"
    " the odometry is uncertain: check the network and the server"
)
PRESENT_S: Final = 0.35
"""Longest silence in s in which the server cannot have been restarted.

ABSENT_TRIPS times the average duration of a query is added to this time.
"""
GAP_S, GAP_LONGEST_S = 0.12, 1.0
"""Times in s to detect a restart of the server by a short silence while the robot is at rest.

* ``GAP_S``: silence, plus twice the average duration of a query, after which the driver reads the
  heading. A heading of exactly zero shows a restart.
* ``GAP_LONGEST_S``: longest wait for this heading, from the end of the silence.
"""
ABSENT_BUSY_S: Final = 2.5
"""Silence in s after which a server that may be busy is regarded as absent.

A stop, for example, keeps the server busy.
"""
RESTARTED_S: Final = 3.0
"""Time without a reply, in s, after which a server whose stop port hangs may have been restarted.
A restart frees the port."""
GREET_S: Final = 1.0
"""Time in s from the start of a controlled move to the first HELLO, and between two HELLOs.

The server answers HELLO only after the move, or after a restart.
"""
ESTOP_REPEAT_S: Final = 0.1
"""Interval in s at which the driver sends stops while the e-stop is latched.

At rest, a stop is harmless: the server only answers ``fail``.
"""


class Ground:
    """The state that all parts of ``Pilot`` share.

    * ``readings``: readings that the caller has not taken yet.
    * ``heard_s``: time of the server's last reply.
    * ``appeared_s``: time of the server's first reply after an absence.
    * ``greeted``: whether the server has answered the first stop of this connection.
    * ``settings``: the sizes and scales of the robot. The caller may replace them.
    """

    def __init__(self, settings: MartSettings) -> None:
        self._settings = settings
        self.conversation = Conversation(settings.network_delay_s)
        self.odometry = MartOdometry(settings)
        self.loop = SpeedLoop(settings)
        self.imu = ImuProof()
        self.health = Health(self.imu)
        self.decoder = MartDecoder()
        self.jobs = Jobs()
        self.proof = StopProof()
        self._surplus = Surplus()
        self._switch_off = SwitchOff()
        self._records = TurnRecords()
        self._turns = SpotTurns(settings, self.odometry, self.loop)
        self._polls = Polls()
        self.readings: list[Reading] = []
        self.lost = 0
        self.now_s = 0.0
        self.connect()

    @property
    def settings(self) -> MartSettings:
        """The sizes and scales of the robot."""
        return self._settings

    @settings.setter
    def settings(self, settings: MartSettings) -> None:
        self._settings = self.odometry.settings = self.loop.settings = settings
        self._turns.settings = settings
        self._turns.keep_lessons()
        self._records.forget()
        self.conversation.delay_s = settings.network_delay_s

    def connect(self) -> None:
        """Begin a new connection. The robot may be moving, so its state is unknown."""
        self.conversation.connect()
        self.jobs.cancel("the connection was lost during the request; call again once it is back")
        self.jobs.forget_log()
        self.odometry.connect()
        self._switch_off.connect()
        self._turns.connect()
        self._polls.connect()
        self.health.connect()
        self.imu.connect()
        self.state, self.motion = State.UNKNOWN, Motion.UNKNOWN
        self.commanded: BodyTwist | None = STANDING
        self._wanted: Wanted = None
        self._stopping: Stopping | None = None
        self._move: Move | None = None
        self._start: Word | None = None
        self._refused = False
        self._moved_last = False
        self._start_owed_until_s = -math.inf
        self._greetings: list[float] = []  # times of HELLOs without an answer
        self._copies_stopped_s = self._first_copy_stop_s = -math.inf
        self._port_free_s = math.inf
        self._port_is_free = self._greeted_before = False
        self._moved_by: Request | None = None
        self._rolled = False
        self._last_move: Request | None = None
        self._recorded: Request | None = None
        self._records.connect()
        self._file_s = -math.inf
        self._started_s = self._begun_s = self._harmful_s = self._halted_s = -math.inf
        self._present_s = self._served_s = -math.inf
        self._again_s = self._said_lost_s = self._estop_said_s = -math.inf
        self._blocked: Motion = Motion.NONE
        self._no_starts = 0
        self._obstacle_told = False
        self._stray_s = self._swept_s = self._stood_s = -math.inf
        self._negative_sweep = self._rescue = self._runs_on = False
        self._rested_s = self._obeyed_s = -math.inf
        self._probes = False
        self._counted_at_rest = 0
        self._fresh = False
        self._conflict = self._released = self._lost_told = False
        self._asked_count: tuple[int, float] | None = None
        self._greet_s = self._free_s = self._name_awaited_s = math.inf
        self._greeted_s = -math.inf
        self._name_from_s = self._named_s = self._stop_again_s = self._ask_s = -math.inf
        self._told: set[str] = set()
        self.heard_s = self.appeared_s = self._gap_s = -math.inf
        self.greeted = False
        self.began_s: float | None = None
        self._next_s = -math.inf

    @property
    def blind_since_s(self) -> float | None:
        """Start time of a controlled move that the server runs or may run again; None without one.

        The server reports no measurements during a move.
        """
        moves = self.motion in (Motion.STRAIGHT, Motion.TURN)
        again = self._last_move is not None and self._copies_stopped_s >= self._rested_s
        return self._started_s if (moves or again) and self.state is not State.LOST else None

    @property
    def refusal(self) -> str:
        """Why the driver refuses motion, with a remedy; empty while motion is allowed."""
        if self.state is State.LOST:
            return (
                "the server is lost: cut the motor power if the robot moves, then restart the"
                " server"
            )
        return self.health.refusal

    def told(self, now: float) -> OdometryReading:
        """Return the odometry, predicted to ``now``."""
        return self.odometry.told(now, blind_since_s=self.blind_since_s)

    @property
    def _absent_s(self) -> float:
        """Silence in s after which the server is regarded as absent, if nothing keeps it busy."""
        return ABSENT_S + ABSENT_TRIPS * self.conversation.answered_trip_s

    @property
    def _seems_present(self) -> bool:
        """Whether replies show that the server was not restarted since the last start command.

        True if, since then, no silence between two replies was long enough for a restart.
        """
        most_s = PRESENT_S + ABSENT_TRIPS * self.conversation.answered_trip_s
        return self.heard_s <= self._present_s + most_s

    def _hears(self, now: float) -> None:
        """Record the arrival of a reply, and decide whether the server may have been restarted.

        A restart is possible after a long silence, or if the server that last answered HELLO was
        not a motion controller.
        """
        most_s = self._absent_s
        if self.heard_s <= self._served_s:
            most_s = ABSENT_BUSY_S  # the driver has waited for pieces of a file
        elif self.state is State.CHECKING:
            most_s += PROBE_S[self.imu.word] - PROBE_S[words.RESET]
        elif self.state not in (State.STILL, *ROLLING):
            most_s = ABSENT_BUSY_S
        in_move = self._stopping is not None and self._stopping.move is not None
        busy = in_move or self.state in (State.MOVING, State.SERVING)
        if (now - self.heard_s > most_s and not busy) or self.health.stranger:
            self._appears(now)
        if now - self.heard_s > RESTARTED_S:
            self.health.was_silent()
        told = self.odometry.heading.told_s >= self._gap_s  # a heading has come since the last gap
        if self.state is State.STILL and told and self._is_quiet(now):
            self._gap_s = now
            self.odometry.heading.may_begin_anew = True
            self._polls.press(words.RMRA)
        self.heard_s = now

    def _is_quiet(self, now: float) -> bool:
        """Return whether a server at rest has been silent for so long that it may be restarting."""
        return now - self.heard_s > GAP_S + 2 * self.conversation.answered_trip_s

    def _appears(self, now: float) -> None:
        """Record that the server may have been restarted, and that its log may be lost."""
        self.appeared_s = now
        self.odometry.appear()
        self.jobs.log_may_be_lost = self.jobs.logging
        self.jobs.ended = False

    def take(self) -> list[Reading]:
        """Return the readings and the results of jobs that came since the last call."""
        if self.jobs.done:
            self.readings += map(ExtraReading, self.jobs.done)
            self.jobs.done.clear()
        readings, self.readings = self.readings, []
        return readings

    def _rest(self, now: float) -> None:
        self._rescue = False
        self.state, self.motion = State.STILL, Motion.NONE
        self._start = None
        self.odometry.stand(now)
        self.commanded = STANDING
        self._fresh = False
        self._polls.press(words.RMRA)
        self._polls.press(words.ENC)
        self._rested_s = now
        self._counted_at_rest = 0
        self._next_s = -math.inf

    @property
    def _rolled_out(self) -> bool:
        """Whether the odometry includes the distance coasted after the last motion."""
        odometry = self.odometry
        return odometry.wheel.from_s >= self._rested_s and odometry.motion is Motion.NONE

    @property
    def _may_run_on(self) -> bool:
        """Whether the motors may still run on, although the server knows of no motion.

        This is so after a drive, until a count shows that the robot is at rest.
        """
        unseen = self._stood_s < max(self.appeared_s, self._started_s)
        driven = self._started_s > -math.inf and not self._moved_last
        return self.state is State.STILL and unseen and driven

    def _waits_for_heading(self) -> bool:
        """Return whether the driver must wait for a heading before it reads the encoder.

        After a forward drive (RM), the odometry needs a heading at rest first. If no heading comes
        in time, the driver logs NO_HEADING once.
        """
        odometry = self.odometry
        by_reference = self.state is State.STILL and odometry.motion is Motion.REFERENCE
        if not by_reference or odometry.heading.from_s >= self._rested_s:
            return False
        longest_s = HEADING_S + HEADING_TRIPS * self.conversation.trip_s
        if self.now_s < self._rested_s + longest_s:
            return True
        self._once(NO_HEADING)
        return False

    def _require(self, word: Word) -> None:
        """Raise AssertionError if the command is not allowed in the current state."""
        if not may_say(self.state, word, self.motion):
            raise AssertionError(f"{word.text} must not be sent while {self.state.value}")

    def _send(self, said: tuple[Word, ...], now: float) -> Packets:
        """Return the packets with the commands ``said``, and record that they are sent at ``now``.

        The driver does not wait for the replies to these commands.
        """
        for word in said:
            self._require(word)
            if word in HARMFUL_LATE:
                self._harmful_s = now
            if word in (words.SM, words.SRM):
                self._halted_s = now
        return tuple((word.channel, word.request().data) for word in said)

    def _greet(self, now: float) -> Packets:
        self._greeted_s = now
        self._greetings.append(now)
        del self._greetings[:-MOST_GREETINGS]
        return ((words.COMMAND, words.HELLO.request().data),)

    def _ask(self, request: Request, now: float) -> Packets:
        return self.conversation.ask(request, now)

    def _notice(self, text: str, *, halt: bool) -> None:
        self.readings.append(NoticeReading(text, halt))

    def _once(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._notice(text, halt=False)

    @property
    def _late_s(self) -> float:
        """Estimated delay of a datagram on its way to the server, in s."""
        return min(self._delay_s, self.conversation.trip_s)

    @property
    def _delay_s(self) -> float:
        return self._settings.network_delay_s
