# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A Fejemis as a board of the driver: two Teensys as one robot.

Composes the parts, and says requests. Which half is where is in ``ports.py``, what follows from a
message in ``inbound.py``, what it is worth in ``translation.py``, how an order is said in
``encoder.py``, what stops the robot in ``watch.py``, whether it obeys in ``obedience.py``, what
keeps both boards talking in ``upkeep.py``, and what else a user may ask in ``services.py``.
"""

import math
from typing import Final

from omnibot_driver.core.board import Board, BoardFigures, Mode
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.fejemis.actuator import PairStream
from omnibot_driver.core.fejemis.angle_relay import AngleRelay
from omnibot_driver.core.fejemis.encoder import Encoder
from omnibot_driver.core.fejemis.inbound import Inbound
from omnibot_driver.core.fejemis.machine import OFF
from omnibot_driver.core.fejemis.motion_lines import STOP
from omnibot_driver.core.fejemis.obedience import Obedience
from omnibot_driver.core.fejemis.ports import ROLES, Ports
from omnibot_driver.core.fejemis.services import Services
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.shown import own_figures
from omnibot_driver.core.fejemis.steering import Geometry
from omnibot_driver.core.fejemis.told import Told
from omnibot_driver.core.fejemis.translation import Translation
from omnibot_driver.core.fejemis.upkeep import Upkeep
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import Reading
from omnibot_driver.core.traits import Traits

STOPS_WITHIN_S: Final = 0.5
"""How long after Stop a configuration is loaded."""


class FejemisBoard(Board):
    """One robot. ``settings`` may be replaced at any time.

    ``services``: what only this board has.
    """

    def __init__(self, settings: FejemisSettings) -> None:
        self._settings = settings
        self._ports = Ports(settings)
        self._translation = Translation(settings)
        self._encoder = Encoder(self, settings)
        self._upkeep = Upkeep(self._ports, settings)
        self._told = Told()
        self._relay = AngleRelay()
        self._obedience = Obedience()
        parts = self._ports, self._translation, self._upkeep, self._obedience, self._told
        self._inbound = Inbound(*parts, self._angle_told)
        odometry = self._translation.odometry
        self.services = Services(self, self._upkeep, self._obedience, odometry, self._told)
        self._actuator: PairStream | None = None
        self.clock = self._translation.stamped
        self._now = -math.inf

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
        self._upkeep.configure(settings)

    @property
    def mode(self) -> Mode:
        """Nominal while both halves talk and the drive board obeys."""
        return self._inbound.mode

    @property
    def geometry(self) -> Geometry:
        """B and F, as the drive board computes with them where that is known."""
        return self._upkeep.geometry

    @property
    def front_angle_rad(self) -> float | None:
        """Where the front wheel stands; None where that is not known well enough to drive."""
        front = self._translation.front
        return front.drives_by_rad if front.known(self._now) else None

    @property
    def with_sums(self) -> bool:
        """Whether lines to both boards have sums."""
        return self._ports.with_sums

    @property
    def driving(self) -> bool:
        """Whether a motion is commanded."""
        return self._actuator is not None and self._actuator.driving

    @property
    def refusal(self) -> str:
        """Why the robot is not to be driven."""
        if self._upkeep.jobs.powering_off:
            return "power is about to be cut"
        if job := self._upkeep.jobs.at_rest:
            return job
        return (
            self._ports.trouble
            or self._upkeep.pending
            or self._inbound.watch.refusal
            or self._encoder.follower.refusal
        )

    @property
    def advice(self) -> str | None:
        """What a user should look at; None while all is well."""
        return self._upkeep.advice

    @property
    def figures(self) -> BoardFigures:
        """Over all connections."""
        halves = self._ports.halves
        return BoardFigures(
            rates_hz={"IMU": 100.0, "Odometry": 50.0},
            trouble=self.refusal,
            faults=sum(half.statistics.faults for half in halves),
            discarded_bytes=sum(half.statistics.discarded_bytes for half in halves),
            own=own_figures(self._ports, self._upkeep, self._translation, self._obedience.source),
        )

    # Inbound

    def connect(self) -> None:
        """The lines are new: brush and lift are off, and both boards are configured again."""
        self._now = -math.inf
        self._ports.begin(self._settings)
        self._translation.connect()
        self._encoder.begin()
        self._upkeep.begin()
        self._inbound.begin()
        self._obedience.begin()

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """The readings that these bytes complete."""
        self._open(now)
        self._inbound.receive(data, now, channel)
        self._look(now)
        return self._taken(now)

    def flush(self, now: float) -> list[Reading]:
        """The lines are closed: half a line is dropped, and a job is answered."""
        self._open(now)
        for half in self._ports.halves:
            half.decoder.flush(now)
        self._upkeep.jobs.begin()
        return self._taken(now)

    def silence(self) -> None:
        """Neither half was heard."""
        self._inbound.mode = Mode.UNKNOWN
        for half in self._ports.halves:
            half.subscribe_again()
        self._upkeep.machine.off()

    def stalled(self) -> None:
        """The guard has switched brush and lift off; neither comes back by itself."""
        if self._upkeep.machine.active:
            self._upkeep.machine.off()

    def elapse(self, now: float) -> list[Reading]:
        """What becomes known as nothing comes."""
        self._open(now)
        self._look(now)
        return self._taken(now)

    def _open(self, now: float) -> None:
        self._now = now
        self._inbound.watch.open(now)
        self._translation.stamped.begin()

    def _taken(self, now: float) -> list[Reading]:
        for notice in self._told.notices:
            self._translation.add(notice, now)
        for done in self._upkeep.jobs.done:
            self._translation.extra(done, now)
        self._told.notices.clear()
        self._upkeep.jobs.done.clear()
        return self._translation.stamped.readings

    def _look(self, now: float) -> None:
        self._inbound.look(now, driving=self.driving)

    def _angle_told(self, angle_rad: float, now: float) -> bool:
        return self._actuator is not None and self._actuator.angle_told(angle_rad, now)

    def remark(self, text: str) -> None:
        """Queue a notice that the user gets only once."""
        self._told.remark(text)

    def reset_odometry(self) -> None:
        """The origin is the driver's own: on the board ``enc0`` would look like a restart."""

    # Outbound

    def actuator(self, proof: StopProof) -> PairStream:
        """Set-points for both halves."""
        self._actuator = PairStream(self._encoder, proof, self)
        return self._actuator

    def wanted(self, *, estop: bool) -> None:
        """Whether what is wanted from now on is an emergency stop."""
        if not estop:
            self._obedience.release(self._now)
        elif not self._obedience.estopped:
            self._upkeep.machine.off()
            self._obedience.latch(running=self.mode is Mode.NOMINAL)
            self._upkeep.jobs.interrupt("the e-stop was latched meanwhile; release it, call again")

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

    def switch_off(self) -> Packets:
        """Lift and brush off, lights as they were."""
        return self._ports.line("front", *self._upkeep.machine.switch_off())

    def wake(self) -> Packets:
        """Stop, and what else may turn."""
        return self.stop() + self._all_off()

    def start(self) -> Packets:
        """What was commanded before may hold again, so that is zero first; not in an e-stop."""
        if self._obedience.estopped:
            return NO_PACKETS
        self._obedience.pause_said = False
        self._encoder.follower.start()
        return self.stop() + self._ports.line("drive", *self._upkeep.jobs.keep_power(), b"start")

    def pause(self) -> Packets:
        """Stop, ``stop``, and what else turns."""
        self._obedience.pause()
        self._upkeep.jobs.interrupt("the robot was paused meanwhile; call again")
        self._upkeep.machine.off()
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
        if self._inbound.relay_rad is not None or self._told.notices or self._upkeep.jobs.done:
            return -math.inf
        wake_at = min(self._upkeep.wake_at, self._obedience.start_at)
        if self._upkeep.machine.active:
            wake_at = min(wake_at, self._inbound.watch.front_unheard_at)
        return min(wake_at, self._inbound.watch.wake_at) if self.mode is Mode.NOMINAL else wake_at

    def due(self, now: float) -> Packets:
        """The relayed angle first, then what keeps both talking."""
        packets = NO_PACKETS
        if (angle_rad := self._inbound.take_relay()) is not None:
            text = self._relay.text(angle_rad, sums=self.with_sums)
            packets = self._ports.line("drive", text)
        if self._obedience.start_due(now):
            packets += self._ports.line("drive", b"start")
        texts = self._upkeep.due(now, stands=not self.driving)
        for role in ROLES:
            if texts[role]:
                packets += self._ports.line(role, *texts[role])
        return packets
