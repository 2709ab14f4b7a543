# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A Fejemis as a board of the driver: two Teensys as one robot.

Here is what follows from what: when the robot is to be stopped, and what each half is owed. Which
half is where is in `ports.py`, what a message is worth in `translation.py`, how an order is said in
`encoder.py`.
"""

import math
from typing import Final

from omnibot_driver.core.board import Board, BoardFigures, Mode
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis.actuator import PairStream
from omnibot_driver.core.fejemis.configuration import Configuration
from omnibot_driver.core.fejemis.encoder import Encoder
from omnibot_driver.core.fejemis.front_wheel import relay_text
from omnibot_driver.core.fejemis.half import NEEDED, SILENT_S, Half, Role, keyword_of
from omnibot_driver.core.fejemis.jobs import Jobs
from omnibot_driver.core.fejemis.machine import OFF, Machine
from omnibot_driver.core.fejemis.messages import FrontAngle, Heartbeat, Message
from omnibot_driver.core.fejemis.motion_lines import STOP
from omnibot_driver.core.fejemis.polls import Polls
from omnibot_driver.core.fejemis.ports import PARAMETERS, ROLES, Ports
from omnibot_driver.core.fejemis.readings import Job
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.shown import own_figures
from omnibot_driver.core.fejemis.steering import Geometry
from omnibot_driver.core.fejemis.translation import Translation
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import NoticeReading, PausedReading, Reading
from omnibot_driver.core.traits import Traits

STOPPED: Final = -1.0
"""rcSource of a drive board that obeys nothing (manual, start)."""
NO_POSE_S: Final = 0.25
"""A robot whose pose is older is driven no further."""
FLOWS_S: Final = 0.5
RELEASED_S: Final = 1.0
"""How long ``start`` is repeated after an e-stop; a stopped board is expected meanwhile."""
START_AGAIN_S: Final = 0.2
UNHEARD_S: Final = 3.0
"""A board that is silent for this time after the port was opened is reported."""
TELL_EVERY_S: Final = 10.0
"""The same notice is repeated no more often."""
GEOMETRIES_DIFFER_M: Final = 0.002


class FejemisBoard(Board):
    """One robot. ``settings`` may be replaced at any time."""

    def __init__(self, settings: FejemisSettings) -> None:
        self._settings = settings
        self._ports = Ports(settings)
        self._translation = Translation(settings)
        self._encoder = Encoder(self, settings)
        self._machine, self._jobs = Machine(), Jobs()
        self._configurations = {role: Configuration(role, settings.written) for role in ROLES}
        self._polls = {role: Polls(role) for role in ROLES}
        self._actuator: PairStream | None = None
        self._told_at: dict[str, float] = {}
        self._notices: list[NoticeReading] = []
        self._mode = Mode.UNKNOWN
        self._estopped = self._resume = False
        self.clock = self._translation.stamped
        self._forget()

    def _forget(self) -> None:
        self._mode = Mode.UNKNOWN
        self._now, self._begun_at = -math.inf, math.inf
        self._relay: float | None = None
        self._source: float | None = None
        self._pause_said = False
        self._released_at = -math.inf
        self._start_at = math.inf
        self._blind = self._unposed = False

    # What is so

    @property
    def traits(self) -> Traits:  # type: ignore[override]
        """The channels are named by what is at them."""
        return self._ports.traits

    @property
    def settings(self) -> FejemisSettings:
        """What the wire does not tell."""
        return self._settings

    @settings.setter
    def settings(self, settings: FejemisSettings) -> None:
        self._settings = self._encoder.settings = settings
        self._translation.configure(settings)
        self._ports.configure(settings)
        for configuration in self._configurations.values():
            configuration.configure(settings.written)

    @property
    def mode(self) -> Mode:
        """Nominal while both halves talk and the drive board obeys."""
        return self._mode

    @property
    def geometry(self) -> Geometry:
        """B and F, as the drive board computes with them where that is known."""
        nominal = Geometry(self._settings.track_m, self._settings.wheelbase_m)
        return self._configurations["drive"].geometry or nominal

    @property
    def front_angle_rad(self) -> float | None:
        """Where the front wheel stands; None where that is not known well enough to drive."""
        front = self._translation.front
        return front.angle_rad if front.known(self._now) else None

    @property
    def with_sums(self) -> bool:
        """Whether lines to both boards have sums."""
        return self._ports.with_sums

    @property
    def refusal(self) -> str:
        """Why the robot is not to be driven."""
        if self._jobs.powering_off:
            return "power is about to be cut"
        if trouble := self._ports.trouble:
            return trouble
        if fault := self._translation.front.fault:
            return f"the angle sensor of the front wheel reports: {fault}; check sensor and magnet"
        if self._blind:
            return (
                "nothing was heard of the angle of the front wheel for 60 ms; check the front board"
            )
        if self._unposed:
            return "nothing was heard of the pose for 0.25 s; check the drive board and its cable"
        return ""

    @property
    def advice(self) -> str | None:
        """What a user should look at; None while all is well."""
        for configuration in self._configurations.values():
            if configuration.failed:
                names = ", ".join(setting.command for setting in configuration.failed)
                return (
                    f"the {configuration.role} board does not keep what was written with {names};"
                    " check the values, and its firmware"
                )
        for half in self._ports.halves:
            if half.decoder.contradicted:
                return (
                    f"the lines of the {half.role} board contradict `line_sums`"
                    f" ({self._settings.line_sums}): set it to auto"
                )
            if unknown := half.unknown_streams:
                return (
                    f"the firmware of the {half.role} board does not know {', '.join(unknown)}:"
                    " what rests on it is missing; update the firmware"
                )
        one, other = (self._configurations[role].geometry for role in ROLES)
        if one and other and _differ(one, other):
            return (
                "the boards are configured to different steering geometries (confs): drive has"
                f" B {one.track_m:g} m and F {one.wheelbase_m:g} m, front has B {other.track_m:g} m"
                f" and F {other.wheelbase_m:g} m; set both by the parameters of the geometry"
            )
        return None

    @property
    def figures(self) -> BoardFigures:
        """Over all connections."""
        halves, translation = self._ports.halves, self._translation
        own = own_figures(self._ports, self._polls, self._configurations, translation.front)
        return BoardFigures(
            rates_hz={"IMU": 100.0, "Odometry": 50.0},
            trouble=self.refusal,
            faults=sum(half.statistics.faults for half in halves),
            discarded_bytes=sum(half.statistics.discarded_bytes for half in halves),
            own=own
            | {
                "Source (rcSource)": "unknown" if self._source is None else f"{self._source:g}",
                "Brush": "on" if self._machine.brush else "off",
                "Lift (V)": f"{self._machine.volts:g}",
                "Angles refused": str(translation.front.refused),
                "Poses refused": str(translation.odometry.refused),
            },
        )

    # Inbound

    def connect(self) -> None:
        """The lines are new: brush and lift are off, and both boards are configured again."""
        self._forget()
        self._ports.begin(self._settings)
        self._translation.connect()
        self._encoder.begin()
        self._machine.off()
        self._jobs.begin()
        for role in ROLES:
            self._begin_half(role)

    def _begin_half(self, role: Role) -> None:
        self._configurations[role].begin()
        self._polls[role].begin()

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """The readings that these bytes complete."""
        self._open(now)
        half = self._ports.halves[channel]
        for message in half.feed(data, now):
            if half.restarted:
                half.restarted = False
                self._restarted(half, now)
            self._hear(half, message, now)
        if half.not_understood(now):
            self._tell(
                f"many lines from the {self._ports.role(channel)} board are damaged or not"
                " understood: check the cable, and whether another program asks it for help text",
                now,
                halt=False,
            )
        if half.decoder.changed:
            half.decoder.changed = False
            ended = "have sums now" if half.decoder.sums else "have no sums any more"
            self._tell(f"the lines of the {half.role} board {ended}; robot stopped", now)
        self._look(now)
        return self._taken(now)

    def flush(self, now: float) -> list[Reading]:
        """The lines are closed: half a line is dropped, and a job is answered."""
        self._open(now)
        for half in self._ports.halves:
            half.decoder.flush(now)
        self._jobs.begin()
        return self._taken(now)

    def silence(self) -> None:
        """Neither half was heard."""
        self._mode = Mode.UNKNOWN
        for half in self._ports.halves:
            half.subscribe_again()
        self._machine.off()

    def elapse(self, now: float) -> list[Reading]:
        """What becomes known as nothing comes."""
        self._open(now)
        self._look(now)
        return self._taken(now)

    def _open(self, now: float) -> None:
        self._now = now
        self._begun_at = min(self._begun_at, now)
        self._translation.stamped.begin()

    def _taken(self, now: float) -> list[Reading]:
        for notice in self._notices:
            self._translation.add(notice, now)
        for done in self._jobs.done:
            self._translation.extra(done, now)
        self._notices.clear()
        self._jobs.done.clear()
        return self._translation.stamped.readings

    def _tell(self, text: str, now: float, *, halt: bool = True) -> None:
        """The same at most once in a while, but every halt is obeyed."""
        if now - self._told_at.get(text, -math.inf) < TELL_EVERY_S:
            text = ""
        else:
            self._told_at[text] = now
        if halt or text:
            self._notices.append(NoticeReading(text, halt))

    def remark(self, text: str) -> None:
        """Something a user should be told once."""
        if text not in self._told_at:
            self._tell(f"{text} (said once)", self._now, halt=False)
            self._told_at[text] = math.inf

    def _hear(self, half: Half, message: Message, now: float) -> None:
        if isinstance(message, Heartbeat):
            self._heartbeat(half, message, now)
        if (role := half.role) is None:
            return
        if keyword := keyword_of(message):
            half.note(keyword, now)
        self._jobs.hear(role, message, now)
        self._configurations[role].hear(message)
        self._polls[role].hear(message)
        self._configurations["front"].turned = self._configurations["drive"].turned
        if isinstance(message, FrontAngle):
            if role == "front":
                self._front_angle(message, now)
        elif role == "drive":
            self._translation.odometry.track_m = self.geometry.track_m
            self._translation.hear_drive(message, half.clock, now)
        else:
            self._translation.hear_front(message, now)
        if self._jobs.reload:
            self._jobs.reload = False
            for configuration in self._configurations.values():
                configuration.begin()

    def _heartbeat(self, half: Half, message: Heartbeat, now: float) -> None:
        if self._ports.identify() and self._ports.swapped:
            self._tell(
                "the ports are swapped: the drive board is at `front_port`, which works as well",
                now,
                halt=False,
            )
        if trouble := self._ports.trouble:
            self._tell(f"{trouble}; robot stopped", now)
        if half.role != "drive":
            return
        self._source = message.state
        if self._source != STOPPED:
            self._start_at = math.inf
        if self._is_stopped(now):
            was_paused, self._mode = self._mode is Mode.PAUSED, Mode.PAUSED
            self._machine.off()
            self._translation.add(PausedReading(continues=was_paused), now)

    def _front_angle(self, message: FrontAngle, now: float) -> None:
        front = self._translation.front
        if not front.hear(message, now):
            return
        self._relay = front.angle_rad
        self._translation.steering(front.angle_rad, now)
        if self._actuator is not None and self._actuator.angle_told(front.angle_rad, now):
            self._tell(
                "the front wheel does not go where it is commanded; robot stopped. Check the servo"
                " and its power; for reversing see `allow_reverse`",
                now,
            )

    # What follows

    def _restarted(self, half: Half, now: float) -> None:
        if (role := half.role) is None:
            return
        self._mode = Mode.UNKNOWN
        self._begin_half(role)
        if role == "drive":
            self._translation.restarted()
        else:
            self._translation.front.begin()
        self._machine.begin()
        self._jobs.cancel(f"the {role} board has restarted")
        self._tell(f"the {role} board has restarted; robot stopped", now)

    def _look(self, now: float) -> None:
        """What the times say."""
        for channel in (0, 1):
            self._look_at(channel, now)
        self._watch(now)
        if not self._ports.ready:
            self._mode = Mode.UNKNOWN
        else:
            self._mode = Mode.PAUSED if self._is_stopped(now) else Mode.NOMINAL

    def _look_at(self, channel: int, now: float) -> None:
        half, parameter = self._ports.halves[channel], PARAMETERS[channel]
        role = half.role
        silent = now - half.heard_at > SILENT_S
        if role is None:
            other = self._ports.halves[1 - channel]
            if silent and now - self._begun_at > UNHEARD_S and other.role is not None:
                missing = self._ports.role(channel)
                self._tell(
                    f"nothing is heard from the {missing} board at `{parameter}`; check its power"
                    " and cable",
                    now,
                )
            return
        unheard_s = now - half.came_at(NEEDED[role])
        if unheard_s < FLOWS_S:
            half.ready = half.heartbeat is not None
        elif half.ready and unheard_s > SILENT_S:
            what = "is silent" if silent else f"sends no `{NEEDED[role]}` any more"
            self._tell(
                f"the {role} board {what}; robot stopped. Check its power and the cable at"
                f" `{parameter}`",
                now,
            )
            half.subscribe_again()
            self._machine.off()

    def _watch(self, now: float) -> None:
        """Angle and pose: too old to drive by."""
        drive, front = self._ports.half("drive"), self._translation.front
        was_blind, was_unposed = self._blind, self._unposed
        self._blind = not front.known(now)
        self._unposed = drive is None or now - drive.came_at("pose") > NO_POSE_S
        if self._actuator is None or not self._actuator.driving:
            return
        if front.fault:
            self._tell(f"{self.refusal}; robot stopped", now)
        elif self._blind and not was_blind:
            self._tell("no angle of the front wheel for 60 ms; robot stopped", now)
        if self._unposed and not was_unposed:
            self._tell("no pose from the drive board for 0.25 s; robot stopped", now)

    def _is_stopped(self, now: float) -> bool:
        """Whether the drive board obeys nothing, and not because of an e-stop of ours."""
        if self._source != STOPPED or not self._ports.ready:
            return False
        if self._pause_said or self._mode is Mode.PAUSED:
            return True
        return not self._estopped and now - self._released_at > RELEASED_S

    def reset_odometry(self) -> None:
        """The origin is the driver's own: on the board ``enc0`` would look like a restart."""

    # Outbound

    def actuator(self, proof: StopProof) -> PairStream:
        """Set-points for both halves."""
        self._actuator = PairStream(self._encoder, proof, self)
        return self._actuator

    def wanted(self, *, estop: bool) -> None:
        """Whether what is wanted from now on is an emergency stop."""
        if estop and not self._estopped:
            self._machine.off()
            self._resume = self._mode is Mode.NOMINAL
        elif self._estopped and not estop and self._resume and not self._pause_said:
            self._released_at, self._start_at = self._now, -math.inf
        self._estopped = estop

    def motion(self, drive: bytes, front: bytes) -> Packets:
        """These lines to the two boards."""
        return self._ports.line("drive", drive) + self._ports.line("front", front)

    def stop(self) -> Packets:
        """``rc 2 0 0`` to both."""
        return self._ports.both(STOP)

    def emergency_stop(self) -> Packets:
        """``stop`` to drive; the front board has none, so what turns there is switched off."""
        return self._ports.line("drive", b"stop") + self._all_off()

    def _all_off(self) -> Packets:
        """Lift and brush."""
        return self._ports.line("front", *OFF)

    def farewell(self) -> Packets:
        """Lift and brush off, lights as they were."""
        return self._ports.line("front", *self._machine.farewell())

    def wake(self) -> Packets:
        """Stop, and what else may turn."""
        return self.stop() + self._all_off()

    def start(self) -> Packets:
        """What was commanded before may hold again, so that is zero first; not in an e-stop."""
        if self._estopped:
            return NO_PACKETS
        self._pause_said = False
        return self.stop() + self._ports.line("drive", *self._jobs.keep_power(), b"start")

    def pause(self) -> Packets:
        """Stop, ``stop``, and what else turns."""
        self._pause_said = True
        self._machine.off()
        return self.stop() + self.emergency_stop()

    def force_pause(self) -> Packets:
        """The same."""
        return self.pause()

    def last_words(self) -> tuple[Packets, Packets]:
        """With brush and lift."""
        return self.wake(), self.emergency_stop() + self.stop()

    @property
    def wake_at(self) -> float:
        """When ``due`` or ``elapse`` have something."""
        if self._relay is not None or self._notices or self._jobs.done:
            return -math.inf
        times = [self._jobs.wake_at, self._machine.wake_at, self._start_at]
        for half in self._ports.halves:
            times.append(half.wake_at)
            if half.role is not None and half.ready:
                times += (self._configurations[half.role].wake_at, self._polls[half.role].wake_at)
        if self._mode is Mode.NOMINAL:
            drive = self._ports.half("drive")
            if not self._blind:
                times.append(self._translation.front.stale_at)
            if not self._unposed and drive is not None:
                times.append(drive.came_at("pose") + NO_POSE_S + 1e-6)
        return min(times)

    def due(self, now: float) -> Packets:
        """The relayed angle first, then what keeps both talking."""
        packets = NO_PACKETS
        if self._relay is not None:
            packets, self._relay = self._ports.line("drive", relay_text(self._relay)), None
        texts: dict[Role, list[bytes]] = {role: [] for role in ROLES}
        if now >= self._start_at:
            texts["drive"].append(b"start")
            again = now - self._released_at < RELEASED_S
            self._start_at = now + START_AGAIN_S if again else math.inf
        texts["front"] += self._machine.due(now)
        for role, more in self._jobs.due(now).items():
            texts[role] += more
        stands = self._actuator is None or not self._actuator.driving
        for channel, half in enumerate(self._ports.halves):
            own = half.due(now)
            if half.role is not None and half.ready:
                polls = self._polls[half.role]
                polls.unknown(half.unknown_words)
                own += self._configurations[half.role].due(now, stands=stands)
                own += polls.due(now)
            texts[self._ports.role(channel)] += own
        for role in ROLES:
            if texts[role]:
                packets += self._ports.line(role, *texts[role])
        return packets

    # What only this board has

    def set_brush(self, on: bool, now: float) -> None:
        """Until it is switched off, or something ends it. Raises RequestRefused."""
        if on and (reason := self._why_not_turn()):
            raise RequestRefused(f"brush not switched on: {reason}")
        self._machine.set_brush(on)

    def lift(self, volts: float, now: float) -> None:
        """For ``command_timeout_s`` at most; positive lifts. Raises CommandRefused."""
        if volts and (reason := self._why_not_turn()):
            raise CommandRefused(f"lift_cmd rejected: {reason}")
        self._machine.lift(volts, now, self._settings.command_timeout_s)

    def set_led(self, red: int, green: int, blue: int, now: float) -> None:
        """Colour of the band, 0..255 each."""
        red, green, blue = (max(0, min(255, part)) for part in (red, green, blue))
        self._machine.set_colour(red, green, blue)

    def ask(self, job: Job, token: object, now: float) -> None:
        """Begin a job; a JobDone answers. Raises RequestRefused."""
        if self._mode is Mode.UNKNOWN:
            raise RequestRefused(f"{job.value} refused: a board is not heard; check both cables")
        if self._actuator is not None and self._actuator.driving:
            if job is not Job.LOAD:
                raise RequestRefused(
                    f"{job.value} refused: the robot is commanded; stop the sender, then call again"
                )
            self._tell("the configuration is being loaded; robot stopped", now)
        if self._translation.odometry.moving and job is not Job.LOAD:
            raise RequestRefused(f"{job.value} refused: the robot moves; wait until it stands")
        self._jobs.ask(job, token, now, delay_s=self._settings.power_off_delay_s)
        if job in (Job.LOAD, Job.POWER_OFF):
            self._machine.off()

    def _why_not_turn(self) -> str:
        if self._estopped:
            return "the e-stop is latched; release it first"
        if self._mode is not Mode.NOMINAL:
            return f"the board is {self._mode.value}"
        return ""


def _differ(one: Geometry, other: Geometry) -> bool:
    return (
        abs(one.track_m - other.track_m) > GEOMETRIES_DIFFER_M
        or abs(one.wheelbase_m - other.wheelbase_m) > GEOMETRIES_DIFFER_M
    )
