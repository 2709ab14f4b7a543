# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What is said to the server next, by what is wanted and by the state of motion.

One decision at a time: stop what must not go on, else answer to what is wanted, else poll. Whatever
is in doubt is stopped. Knows states, words and measurements; not who commands. Time is an argument.
"""

import math
from typing import Final

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import Drive, EmergencyStop, GoTo, Stop
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import Answer, Conversation
from omnibot_driver.core.mart.goal import Move, Surplus, next_move
from omnibot_driver.core.mart.health import Health
from omnibot_driver.core.mart.jobs import Jobs
from omnibot_driver.core.mart.odometry import MartOdometry
from omnibot_driver.core.mart.polls import Polls
from omnibot_driver.core.mart.replies import Fail, MartDecoder, Ok, Reply
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.speed_loop import SpeedLoop, turn_is_on_the_spot
from omnibot_driver.core.mart.states import (
    HALTS,
    HARMFUL_LATE,
    LAST_HALTS,
    NEEDS_IMU,
    STARTS,
    WHILE,
    Motion,
    State,
    may_say,
)
from omnibot_driver.core.mart.stopping import ANSWERS, Stopping
from omnibot_driver.core.mart.words import Form, Kind, Request, Word
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import ExtraReading, NoticeReading, OdometryReading, Reading

PROVED_S: Final = 0.2
"""So old a proof of the IMU may be when a motion starts."""
CHECK_S: Final = 0.5
"""The check takes at least about so long; what it took longer, the proof may be older."""
SLOWEST_MPS, SLOWEST_RADPS = 0.02, 0.03
"""A slower command stands still."""
BLIND_S: Final = 0.8
"""A robot that drives and is not counted for so long is stopped."""
FROZEN_S: Final = 0.5
"""A heading that does not change at all while the robot drives so long comes of no living IMU."""
NO_START_S: Final = 1.5
"""A wheel that is driven turns by then."""
SPIN_RATIO: Final = 0.35
"""A turn on the spot keeps its speed; one that is commanded so much otherwise starts anew."""
AGAIN_S: Final = 1.0
"""After a start that failed."""
STOPS_S: Final = 1.0
"""The answer to a stop takes no longer, as a rule."""
LOST_REPEAT_S: Final = 1.0
ESTOP_REPEAT_S: Final = 0.5
STRAY_COUNTS: Final = 3
"""A robot that stands and is counted so far since the last count moves."""
STRAY_AGAIN_S: Final = 3.0
STANDING: Final = BodyTwist(0.0, 0.0, 0.0)
NAMES: Final = {
    Motion.REFERENCE: "RM",
    Motion.REVERSE: "B",
    Motion.SPIN: "R or L",
    Motion.STRAIGHT: "TF or TB",
    Motion.TURN: "MCR or MCL",
    Motion.UNKNOWN: "a motion of another program",
    Motion.NONE: "nothing",
}


class Pilot:
    """``readings``: what came of the replies, to be taken. ``settings`` may be replaced."""

    def __init__(self, settings: MartSettings) -> None:
        self._settings = settings
        self.conversation = Conversation(settings.network_delay_s)
        self.odometry = MartOdometry(settings)
        self.loop = SpeedLoop(settings)
        self.health = Health()
        self.decoder = MartDecoder()
        self.jobs = Jobs()
        self.proof = StopProof()
        self._surplus = Surplus()
        self._polls = Polls()
        self.readings: list[Reading] = []
        self.lost = 0
        self.connect()

    @property
    def settings(self) -> MartSettings:
        """Sizes and scales."""
        return self._settings

    @settings.setter
    def settings(self, settings: MartSettings) -> None:
        self._settings = self.odometry.settings = self.loop.settings = settings
        self.conversation.delay_s = settings.network_delay_s

    def connect(self) -> None:
        """The line is new: the server may be moving the robot."""
        self.conversation.connect()
        self.jobs.cancel("the line was lost meanwhile; call again once it is back")
        self.jobs.logging = self.jobs.ended = False
        self.odometry.connect()
        self._polls.connect()
        self.health.connect()
        self.state, self.motion = State.UNKNOWN, Motion.UNKNOWN
        self.commanded: BodyTwist | None = STANDING
        self._wanted: Wanted = None
        self._stopping: Stopping | None = None
        self._move: Move | None = None
        self._start: Word | None = None
        self._moved_last = False
        self._moved_by: Request | None = None
        self._proved_s = self._started_s = self._begun_s = self._harmful_s = -math.inf
        self._again_s = self._said_lost_s = self._estop_said_s = -math.inf
        self._spin_radps = self._spin_seen_radps = 0.0
        self._spin_units = 0
        self._custom_units: int | None = None
        self._custom_s = -math.inf
        self._custom_refused = False
        self._blocked: Motion = Motion.NONE
        self._stray_s = self._swept_s = -math.inf
        self._negative_sweep = self._rescue = False
        self._rested_s = -math.inf
        self._counted_at_rest = 0
        self._unanswered = 0
        self._fresh = False
        self._told: set[str] = set()
        self.heard_s = -math.inf
        self.greeted = False
        self.began_s: float | None = None
        self._next_s = -math.inf

    # What is wanted

    def apply(self, wanted: Wanted, now: float) -> None:
        """The newest replaces what was wanted."""
        if wanted is not None:
            self.jobs.cancel("a command came in meanwhile; call again when the robot is to stand")
        if wanted is not self._wanted:
            self._move = None
            if self._wanted is None or wanted is None or _stands(wanted):
                self._blocked = Motion.NONE
        self._wanted = wanted
        if _stands(wanted) and wanted is not None:
            self.proof.stopped(now)
            self._estop_said_s = now - ESTOP_REPEAT_S
        self._next_s = -math.inf

    @property
    def stop_words(self) -> tuple[Word, ...]:
        """What stops the present state, for whoever cannot hear the replies."""
        if self.state is State.LOST:
            return (*HALTS[Motion.UNKNOWN], *LAST_HALTS[self.motion])
        if self.motion is Motion.NONE:
            return HALTS[Motion.UNKNOWN]
        if self._stopping is not None and self._stopping.last_port:
            return (*HALTS[self.motion], *LAST_HALTS[self.motion])
        return HALTS[self.motion]

    @property
    def blind_since_s(self) -> float | None:
        """Since when a controlled move is under way."""
        moves = self.motion in (Motion.STRAIGHT, Motion.TURN)
        return self._started_s if moves and self.state is not State.LOST else None

    def busy(self, now: float) -> bool:
        """The server cannot answer now, and that is as it should be."""
        if self._stopping is not None:
            return self.greeted and now < self._stopping.began_s + STOPS_S
        return self.state in (State.MOVING, State.SERVING, State.CHECKING, State.STARTING)

    @property
    def ready(self) -> bool:
        """The server has told its name, and answered the first stop."""
        return self.greeted and not self.health.stranger and self.state is not State.LOST

    def fell_silent(self) -> None:
        """Nothing came for long, and nothing was awaited: the server may have been restarted."""
        if self.state in (State.STILL, State.UNKNOWN):
            self.connect()

    # Time

    @property
    def wake_at(self) -> float:
        """When ``due`` has to be asked again."""
        return self._next_s

    def due(self, now: float) -> Packets:
        """What to send now."""
        packets = self._due(now)
        self._next_s = self._wake(now)
        return packets

    def _wake(self, now: float) -> float:
        pending = self.conversation.pending
        if self.state is State.STOPPING:
            return self._stopping.wake_at if self._stopping is not None else now
        if self.state is State.LOST:
            return self._said_lost_s + LOST_REPEAT_S
        if pending is not None:
            return min(pending.until_s, self.jobs.wake_at)
        if self.state is State.SERVING:
            return self.jobs.wake_at
        times = [max(self._polls.wake_at(self.state), now + 0.004)]
        if self.state is State.STILL and not _stands(self._wanted):
            times.append(max(now + 0.01, self._again_s, self._harmful_s + self._delay_s))
        return min(times)

    def _due(self, now: float) -> Packets:
        if self.began_s is None:
            self.began_s = now
        if (word := self.conversation.overdue(now)) is not None:
            self._missed(word, now)
        self.jobs.tick(now)
        if self.state is State.SERVING and not self.jobs.collecting:
            pending = self.conversation.pending
            self.state = State.STILL if pending is None else self.state
        if self.state is State.UNKNOWN:
            self._halt(now)
        if self.state is State.STOPPING:
            return self._keep_stopping(now)
        if self.state is State.LOST:
            return self._repeat_lost(now)
        if why := self._why_stop(now):
            self._halt(now, "" if why == "wanted" else why)
            return self._keep_stopping(now)
        if self.conversation.pending is not None:
            return NO_PACKETS
        return self._act(now) or self._poll(now)

    # Stopping

    def _why_stop(self, now: float) -> str:
        """Why what is under way must not go on: a sentence, "wanted", or empty."""
        if self.state not in (State.STARTING, State.MOVING, *_ROLLING):
            return ""
        if self.health.tripped:
            return f"the motor board reports {self.health.tripped}"
        if not self._agrees(now):
            return "wanted"
        if self.state not in _ROLLING:
            return ""
        odometry, rolling_s = self.odometry, now - self._begun_s
        if now - max(odometry.counted_s, self._begun_s) > BLIND_S:
            return "the encoder is not answered while the robot drives"
        if rolling_s > NO_START_S and abs(odometry.speeds[0]) + abs(odometry.speeds[1]) < 1e-3:
            return "the robot is driven and does not move"
        frozen_s = now - max(odometry.heading_changed_s, self._begun_s)
        if frozen_s > FROZEN_S and self._heading_is_told and self._angles_heard > FROZEN_S:
            return "the relative heading does not change: the IMU is dead"
        return ""

    @property
    def _heading_is_told(self) -> bool:
        return self.state is State.DRIVING or (
            self.state is State.REVERSING and self.health.heading_in_reverse
        )

    @property
    def _angles_heard(self) -> float:
        """For how long of this motion headings have come."""
        return self.odometry.heading_s - self._begun_s

    def _agrees(self, now: float) -> bool:
        """Whether the present motion is the one that is wanted."""
        motion, twist = self._wish(now)
        if self.motion in (Motion.STRAIGHT, Motion.TURN):
            return self._move is not None or self.jobs.moving or self._rescue
        if motion is not self.motion:
            return False
        if motion is Motion.SPIN:
            rate = twist.yaw_rate_radps
            return (
                rate * self._spin_radps > 0.0
                and abs(rate - self._spin_radps) <= SPIN_RATIO * abs(self._spin_radps)
            ) or (self._spin_is_fixed and rate * self._spin_radps > 0.0)
        return True

    @property
    def _spin_is_fixed(self) -> bool:
        return self._custom_refused or self._settings.spin_speed == "fixed"

    def _halt(self, now: float, why: str = "") -> None:
        """Stop what is, or may be, under way."""
        if why:
            self._notice(f"{why}; robot stopped", halt=True)
        pending = self.conversation.pending
        answers = ANSWERS.get(self.motion, ())
        owed = int(pending is not None and any(form in answers for form in pending.word.forms))
        self.conversation.give_up(now)
        move = self._start if self.motion in (Motion.STRAIGHT, Motion.TURN) else None
        self._stopping = Stopping(
            self.motion,
            now,
            delay_s=self._delay_s,
            started_s=self._started_s,
            owed=owed,
            move=move,
        )
        self.state = State.STOPPING

    def _keep_stopping(self, now: float) -> Packets:
        stopping = self._stopping
        assert stopping is not None
        if stopping.failed and now >= stopping.wake_at:
            if self.greeted:
                self._lose(now)
            else:
                self.state = State.UNKNOWN
                self._halt(now)
                return self._greet(now)
            return self._repeat_lost(now)
        said = stopping.due(now)
        packets = self._send(said, now)
        if said:
            self.proof.stopped(now)
            self.commanded = STANDING
            if not self.greeted or stopping.asks_name(now):
                packets += self._greet(now)
        return packets

    def _greet(self, now: float) -> Packets:
        return ((words.COMMAND, words.HELLO.request().data),)

    def _send(self, said: tuple[Word, ...], now: float) -> Packets:
        """Words that nothing is awaited of."""
        for word in said:
            self._require(word)
            if word in HARMFUL_LATE:
                self._harmful_s = now
        return tuple((word.channel, word.request().data) for word in said)

    def _require(self, word: Word) -> None:
        """Whatever is sent is in the table; anything else is a defect, and is not sent."""
        if not may_say(self.state, word, self.motion):
            raise AssertionError(f"{word.text} must not be said while {self.state.value}")

    def _stopped(self, now: float) -> None:
        """The server has answered the stop."""
        stopping, self._stopping = self._stopping, None
        self._moved_by = None  # it was cut short
        assert stopping is not None
        result, motion = stopping.result, stopping.motion
        if motion is Motion.SPIN and isinstance(result, Ok) and result.form is Form.INTEGER:
            self._spin_over(result.number, now)
        if motion is Motion.STRAIGHT:
            self.odometry.finish_straight()
        if isinstance(result, Fail):
            self._failed(motion, result, now)
        if motion is Motion.UNKNOWN:
            self._negative_sweep = result is None
            self._swept_s = now
            self.greeted = True
        self._rest(now)

    def _rest(self, now: float) -> None:
        self._rescue = False
        self.state, self.motion = State.STILL, Motion.NONE
        self._start = None
        self.commanded = STANDING
        self._fresh = False
        self._polls.press(words.RMRA)
        self._polls.press(words.ENC)
        self._rested_s = now
        self._counted_at_rest = 0
        self._unanswered = 0
        self._next_s = -math.inf

    def _spin_over(self, degrees: float, now: float) -> None:
        spun_rad = self.odometry.spun_rad
        if abs(math.radians(degrees) - spun_rad) > 0.3 + 0.4 * abs(spun_rad):
            return
        self.odometry.spin_told(degrees)
        seconds = now - self._begun_s
        if seconds > 1.0 and self._spin_units and abs(spun_rad) > 0.3:
            steady_radps = self._spin_seen_radps * abs(math.radians(degrees) / spun_rad)
            self.loop.spun(self._spin_units, steady_radps)

    def _lose(self, now: float) -> None:
        """The server answers no more, and may be moving the robot."""
        self._stopping = None
        self.state = State.LOST
        self.lost += 1
        self._said_lost_s = -math.inf
        self._notice(
            f"lost: the server does not answer the stop of {NAMES[self.motion]}; motion is refused;"
            " cut the motor power if the robot moves, then restart the server",
            halt=True,
        )

    def _repeat_lost(self, now: float) -> Packets:
        if now < self._said_lost_s + LOST_REPEAT_S:
            return NO_PACKETS
        self._said_lost_s = now
        said = HALTS[self.motion] if self.motion is not Motion.UNKNOWN else HALTS[Motion.UNKNOWN]
        return self._send(said, now) + self._greet(now)

    # Replies

    def hear(self, data: bytes, now: float) -> None:
        """A datagram of the command port."""
        self._next_s = -math.inf
        if self.jobs.collecting:
            self.jobs.piece(data, now)
            return
        for reply in self.decoder.feed(data, now):
            self._hear(reply, now)

    def _hear(self, reply: Reply, now: float) -> None:
        self.heard_s = now
        if isinstance(reply, Ok) and reply.form is Form.NAME:
            self._named(reply, now)
            return
        if self.state is State.LOST:
            return
        if self._stopping is not None:
            if self._stopping.hear(reply, now):
                self._stopped(now)
            return
        answer = self.conversation.hear(reply, now)
        if answer is not None:
            self._unanswered = 0
            self._answered(answer, now)

    def _named(self, reply: Ok, now: float) -> None:
        if reply.text != "BBB":
            self._once(
                f"another server answers HELLO with '{reply.text}', not with 'BBB': check `port`;"
                " motion is refused"
            )
            self.health.stranger = reply.text
            return
        self.health.stranger = ""
        self.conversation.hear(reply, now)
        if self._stopping is not None and self._stopping.asks_name(now):
            self._stopped(now)  # the command port is free: the move is over, its reply was lost
        if self.state is State.LOST:
            self._notice("the server answers again; it is stopped first", halt=True)
            self.state, self.motion = State.UNKNOWN, Motion.UNKNOWN

    def _answered(self, answer: Answer, now: float) -> None:
        word, reply = answer.word, answer.reply
        at_s = now - answer.took_s / 2
        if word.kind is Kind.QUERY:
            self._measured(answer, at_s, now)
        elif word is words.CHECK:
            self._checked(reply, answer.took_s, now)
        elif word.kind is Kind.START:
            self._started(reply, now)
        elif word.kind is Kind.CHANGE:
            if isinstance(reply, Fail):
                self._halt(now, self._obstacle(reply, self.motion))
            elif reply.form is Form.DECIMAL:
                self.odometry.turned(reply.number, at_s, doubtful=answer.doubtful)
        elif word.kind is Kind.MOVE:
            self._moved(reply, now)
        elif word is words.SSP:
            self._custom_set(reply)
        else:
            self.jobs.answered(answer, now)
            self.state = State.SERVING if self.jobs.collecting else State.STILL

    def _missed(self, word: Word, now: float) -> None:
        """No reply came in time."""
        if word.kind is Kind.START:
            self._halt(now, f"{word.text} was not answered")
        elif word.kind is Kind.MOVE:
            self._halt(now)  # its reply is lost, or it takes too long; the way is planned anew
        elif word is words.CHECK:
            self.state = State.STILL
            self._again_s = now + 0.1
        elif word.kind is Kind.SERVICE:
            self.state = State.STILL
            self.jobs.missed(word, now)
        else:
            self._polls.press(word)
            self._unanswered += 1

    def _measured(self, answer: Answer, at_s: float, now: float) -> None:
        word, reply = answer.word, answer.reply
        if isinstance(reply, Fail):
            if word is words.ENC:
                self.health.encoder_failed()
            return
        if word is words.ENC:
            self._counted(int(reply.number), at_s, now, doubtful=answer.doubtful)
        elif word is words.RMRA:
            self.odometry.turned(reply.number, at_s, doubtful=answer.doubtful)
            if self.state is State.REVERSING and self.odometry.heading_changed_s > self._begun_s:
                self.health.heading_in_reverse = True
        else:
            self.readings += self.health.measured(word, reply, now)
            self.loop.volts = self.health.volts_or(self._settings.nominal_volts)

    def _counted(self, count: int, at_s: float, now: float, *, doubtful: bool) -> None:
        before = self.odometry.count
        reading = self.odometry.counted(count, at_s, doubtful=doubtful)
        if reading is None:
            return
        self.health.encoder_answers()
        self.readings.append(reading)
        speed, rate = self.odometry.speeds
        if self.state is State.STILL:
            if self._moved_by is not None and self.odometry.motion is not Motion.NONE:
                self._surplus.learn(self._moved_by, self.odometry.moved_m, self.odometry.spun_rad)
                self._moved_by = None
            self.odometry.rest()
            self._watch_stray(before, count, now)
        elif self.state is State.TURNING:
            self._spin_seen_radps = rate
        else:
            self._fresh = True
            self.loop.measured(speed, rate, reading.dyaw_rad, now)
        if self.state is State.REVERSING and not self.health.heading_in_reverse:
            right, left = self.loop.units
            if now - self._begun_s > FROZEN_S and right:
                self.odometry.left_over_right = left / right

    def _watch_stray(self, before: int | None, count: int, now: float) -> None:
        """A robot that stands is counted: a late copy of a start, another client, or a push."""
        self._counted_at_rest += 1
        if self._counted_at_rest < 2 or now - self._rested_s < 0.3 or before is None:
            return
        if abs(count - before) <= STRAY_COUNTS or now - self._stray_s < STRAY_AGAIN_S:
            return
        if self._negative_sweep and now - self._swept_s < 2.0:
            self._stray_s = now
            self._rescue = True
            self._notice(
                "the robot moves, and the server knows of no motion: a turn by 1 degree is begun,"
                " which ends with the motors off",
                halt=True,
            )
            return
        self._notice(
            "the robot moves without a command: a late copy of one, another client, or a push;"
            " it is stopped",
            halt=True,
        )
        self.motion = Motion.UNKNOWN
        self._halt(now)

    # Acting

    def _order(self, now: float) -> Drive | GoTo | None:
        wanted = self._wanted
        if wanted is None or isinstance(wanted, Stop | EmergencyStop) or wanted.is_zero:
            return None
        order = wanted.order(now)
        return order if isinstance(order, Drive | GoTo) else None

    def _wish(self, now: float) -> tuple[Motion, BodyTwist]:
        """The motion that is wanted, and how fast."""
        order = self._order(now)
        if not isinstance(order, Drive):
            return Motion.NONE, STANDING
        speed, rate = order.twist.vx_mps, order.twist.yaw_rate_radps
        if abs(speed) < SLOWEST_MPS and abs(rate) < SLOWEST_RADPS:
            return Motion.NONE, STANDING
        if turn_is_on_the_spot(speed, rate, self._settings.track_m):
            return Motion.SPIN, BodyTwist(0.0, 0.0, rate)
        motion = Motion.REFERENCE if speed > 0.0 else Motion.REVERSE
        return motion, BodyTwist(speed, 0.0, rate)

    def _act(self, now: float) -> Packets:
        if self.state is State.STILL:
            return self._act_still(now)
        if self.state in (State.DRIVING, State.REVERSING) and self._fresh:
            return self._adjust(now)
        return NO_PACKETS

    def _adjust(self, now: float) -> Packets:
        """One change of the motors' units, where the measured speed asks for one."""
        self._fresh = False
        _, twist = self._wish(now)
        change = self.loop.change(abs(twist.vx_mps), twist.yaw_rate_radps, now)
        self.commanded = twist
        if change is None:
            return NO_PACKETS
        right, left = change
        self._require(words.RMCS if self.state is State.DRIVING else words.CS)
        self.loop.changed(right, left, now)
        if self.state is State.DRIVING:
            return self._ask(words.RMCS.request(right, left), now)
        return self._ask(words.CS.request(-right, -left), now)

    def _act_still(self, now: float) -> Packets:
        if isinstance(self._wanted, EmergencyStop) and now - self._estop_said_s >= ESTOP_REPEAT_S:
            self._estop_said_s = now
            self.proof.stopped(now)
            return self._send(HALTS[Motion.UNKNOWN], now)
        if self._rescue:
            return self._begin(words.MCR.request("SLOW", 1), now)
        if self._unanswered >= 2 and self._moved_last:
            # A late copy of a controlled move would keep the port silent.
            self._unanswered = 0
            return self._send((words.SL, words.SS), now)  # RM and B would hang by them
        if self.odometry.counted_s < self._rested_s:
            return NO_PACKETS  # how it rolled out is counted before the count begins anew
        start = self._next_start(now)
        if start is None:
            return self._job(now)
        if now < self._again_s:
            return NO_PACKETS
        if why := self.refusal:
            self._notice(why, halt=True)
            return NO_PACKETS
        if packets := self._prepare_spin(start, now):
            return packets
        if now < self._harmful_s + self._delay_s:
            return NO_PACKETS
        if start.word in NEEDS_IMU and now > self._proved_s + PROVED_S:
            return self._check(now)
        if self.odometry.counted_s < self._harmful_s + self._delay_s:
            return NO_PACKETS  # a late copy of a move would have the port now
        return self._begin(start, now)

    @property
    def refusal(self) -> str:
        """Why the robot is not to be driven, and what to do; empty if it may be."""
        if self.state is State.LOST:
            return (
                "the server is lost: cut the motor power if the robot moves, then restart the"
                " server"
            )
        return self.health.refusal

    def _next_start(self, now: float) -> Request | None:
        order = self._order(now)
        if isinstance(order, GoTo):
            return self._next_goal_move(order, now)
        motion, twist = self._wish(now)
        if motion is Motion.NONE or motion is self._blocked:
            return None
        if motion is Motion.SPIN:
            return self._spin_request(twist.yaw_rate_radps)
        if self.health.obstacle(motion, now):
            self._block(motion, "an obstacle is too near")
            return None
        if motion is Motion.REFERENCE:
            units = self.loop.first_units(twist.vx_mps, twist.yaw_rate_radps)
            return words.RM.request(units)
        return words.B.request("SLOW")

    def _spin_request(self, rate_radps: float) -> Request:
        word = words.L if rate_radps > 0.0 else words.R
        if self._spin_is_fixed:
            return word.request("SLOW")
        return word.request("CUSTOM")

    def _prepare_spin(self, start: Request, now: float) -> Packets:
        """R and L take their speed from SSP, which has to come before the check of the IMU."""
        if start.word not in (words.R, words.L) or self._spin_is_fixed:
            return NO_PACKETS
        _, twist = self._wish(now)
        units = self.loop.spin_units(twist.yaw_rate_radps)
        if units == self._custom_units or now < self._custom_s + self._delay_s:
            return NO_PACKETS  # a copy of an older speed must not come after a newer one
        self._spin_units = units
        self._custom_s = now
        return self._ask(words.SSP.request(5, units), now)

    def _custom_set(self, reply: Ok | Fail) -> None:
        if isinstance(reply, Ok):
            self._custom_units = self._spin_units
            return
        self._custom_refused = True
        self._once(
            "the server has no speeds for turns on the spot but its own: they are faster than"
            " commanded (`spin_speed`: fixed)"
        )

    def _check(self, now: float) -> Packets:
        self._require(words.CHECK)
        self.state = State.CHECKING
        self.odometry.zeroed()
        return self._ask(words.CHECK.request(0), now)

    def _checked(self, reply: Ok | Fail, took_s: float, now: float) -> None:
        self.state = State.STILL
        if isinstance(reply, Ok):
            self.health.imu_dead = False
            self._proved_s = now - max(0.0, took_s - CHECK_S)
            if self._proved_s + PROVED_S <= now:
                self._again_s = now
            return
        self._again_s = now + AGAIN_S
        if reply.reason == words.IMU_LOST:
            self.health.imu_dead = True
            self._notice(self.health.refusal, halt=True)
        else:
            self._notice(f"the check of the IMU failed: {reply.reason or 'fail'}", halt=True)

    def _begin(self, start: Request, now: float) -> Packets:
        self._require(start.word)
        self._moved_last = start.word.kind is Kind.MOVE
        self.state, self.motion = State.STARTING, STARTS[start.word]
        self._start = start.word
        self._started_s = now
        self._proved_s = -math.inf
        _, twist = self._wish(now)
        self.commanded = twist
        self._spin_radps = twist.yaw_rate_radps
        if start.word in HARMFUL_LATE:
            self._harmful_s = now
        self.proof.moved()
        self.odometry.forget_speeds()
        self.odometry.begin(self.motion, now)
        if start.word.kind is Kind.MOVE:
            self._moved_by = start
            self.state = State.MOVING
            self.commanded = None
        elif self.motion is Motion.REFERENCE:
            self.loop.begin(int(start.data.split()[1]), False, now)
        elif self.motion is Motion.REVERSE:
            self.loop.begin(SLOW_UNITS, True, now)
        elif self._spin_is_fixed:
            self._spin_units = SLOW_UNITS
        return self.conversation.ask(start, now, takes_s=_longest_s(start))

    def _started(self, reply: Ok | Fail, now: float) -> None:
        if isinstance(reply, Fail):
            self._start_failed(reply, now)
            return
        self.state = WHILE[self.motion]
        self._begun_s = now
        self.odometry.heading_changed_s = now
        self._polls.press(words.RMRA)
        self._polls.press(words.ENC)

    def _start_failed(self, reply: Fail, now: float) -> None:
        """It may move all the same."""
        word = self._start
        assert word is not None
        self._again_s = now + AGAIN_S
        if reply.reason == words.CONFLICT:
            self.motion = Motion.UNKNOWN
            why = "another motion is in progress"
        else:
            why = self._obstacle(reply, self.motion)
        if word is words.RM and reply.reason == "":
            self.health.reference_fails += 1
        if word in (words.R, words.L) and reply.reason == words.UNSUPPORTED:
            self._custom_refused = True
        self._halt(now, f"{word.text} failed ({reply.reason or 'no reason given'}): {why}")

    def _obstacle(self, reply: Fail, motion: Motion) -> str:
        """What a failure within a motion means."""
        if reply.reason in words.OBSTACLES:
            self._block(motion, reply.reason)
            return f"the controller reports an obstacle ({reply.reason})"
        return f"the controller has ended the motion ({reply.reason or 'no reason given'})"

    def _failed(self, motion: Motion, reply: Fail, now: float) -> None:
        """How a motion ended, by the reply to its stop."""
        if reply.reason in words.OBSTACLES:
            self._block(motion, reply.reason)
        elif reply.reason == words.IMU_LOST:
            self.health.imu_dead = True
            self._notice(self.health.refusal, halt=True)
        else:
            self._notice(f"the controller reports: {reply.reason or 'fail'}", halt=True)

    def _block(self, motion: Motion, why: str) -> None:
        """Not that way, until the way is another or the command has ceased."""
        if self._blocked is not motion:
            self._blocked = motion
            where = "behind" if motion is Motion.REVERSE else "in front"
            self._notice(
                f"obstacle {where} ({why}): that way is refused until another command comes",
                halt=False,
            )

    # Goals

    def _next_goal_move(self, order: GoTo, now: float) -> Request | None:
        if self._move is None:
            self._move = Move(order.place)
        request = next_move(self._move, self.odometry.pose, self._settings, self._surplus)
        if request is None:
            return None
        if request.word in NEEDS_IMU and now > self._proved_s + PROVED_S:
            return request
        self._move.said += 1
        return request

    def _moved(self, reply: Ok | Fail, now: float) -> None:
        """A controlled move is over, by its own reply."""
        motion = self.motion
        if motion is Motion.STRAIGHT:
            self.odometry.finish_straight()
        self.jobs.moved(reply, now)
        self._rest(now)
        if isinstance(reply, Fail):
            if self._move is not None:
                self._move.given_up = True
            self._notice(
                f"controlled move ended: {reply.reason or 'fail'}; the goal is discarded; clear the"
                " cause, then send it again",
                halt=True,
            )
            if reply.reason == words.IMU_LOST:
                self.health.imu_dead = True

    # Jobs and polls

    def _job(self, now: float) -> Packets:
        request = self.jobs.next(now, stands=self.proof.proved)
        if request is None:
            return NO_PACKETS
        if request.word in NEEDS_IMU and now > self._proved_s + PROVED_S:
            return self._check(now)
        self.jobs.sent(request, now)
        if request.word in STARTS:
            return self._begin(request, now)
        self._require(request.word)
        self.state = State.SERVING
        if request.word in HARMFUL_LATE:
            self._harmful_s = now
        return self._ask(request, now)

    def _poll(self, now: float) -> Packets:
        for word in self._polls.due(self.state, now):
            if self.conversation.may_ask(word, now):
                self._require(word)
                self._polls.asked(word, now)
                return self._ask(word.request(), now)
        return NO_PACKETS

    def _ask(self, request: Request, now: float) -> Packets:
        return self.conversation.ask(request, now)

    # Telling

    def told(self, now: float) -> OdometryReading:
        """The odometry, predicted to this time."""
        slowing_s = self._stopping.began_s if self._stopping is not None else None
        return self.odometry.told(now, blind_since_s=self.blind_since_s, slowing_since_s=slowing_s)

    def take(self) -> list[Reading]:
        """What came of the replies since the last call."""
        if self.jobs.done:
            self.readings += map(ExtraReading, self.jobs.done)
            self.jobs.done.clear()
        readings, self.readings = self.readings, []
        return readings

    def _notice(self, text: str, *, halt: bool) -> None:
        self.readings.append(NoticeReading(text, halt))

    def _once(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._notice(text, halt=False)

    @property
    def _delay_s(self) -> float:
        return self._settings.network_delay_s


_ROLLING: Final = (State.DRIVING, State.REVERSING, State.TURNING)
STRAIGHT_S_PER_IN, TURN_S_PER_DEG = 0.5, 0.06
"""Of the slowest controlled moves, with a margin."""
SLOW_UNITS: Final = 20
"""Of B SLOW, R SLOW and L SLOW."""


def _longest_s(start: Request) -> float:
    """How long the server may take to answer it."""
    if start.word.kind is not Kind.MOVE:
        return start.word.takes_s
    asked = float(start.data.split()[-1])
    straight = STARTS[start.word] is Motion.STRAIGHT
    return min(
        start.word.takes_s, 3.0 + asked * (STRAIGHT_S_PER_IN if straight else TURN_S_PER_DEG)
    )


def _stands(wanted: Wanted) -> bool:
    return wanted is None or isinstance(wanted, Stop | EmergencyStop) or wanted.is_zero
