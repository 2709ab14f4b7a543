# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Fejemis as a ``Board`` of the driver: its two Teensy boards appear as one robot.

This module composes the text lines that stop, start and pause the robot.
"""

import math

from omnibot_driver.core.board import Board, BoardFigures, Mode
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.fejemis import shown
from omnibot_driver.core.fejemis.actuator import PairStream
from omnibot_driver.core.fejemis.angle_relay import AngleRelay
from omnibot_driver.core.fejemis.encoder import Encoder
from omnibot_driver.core.fejemis.inbound import Inbound
from omnibot_driver.core.fejemis.jobs import POWER_ENDS
from omnibot_driver.core.fejemis.machine import OFF
from omnibot_driver.core.fejemis.motion_lines import STOP
from omnibot_driver.core.fejemis.obedience import Obedience
from omnibot_driver.core.fejemis.ports import Ports
from omnibot_driver.core.fejemis.services import Services
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.steering import Geometry
from omnibot_driver.core.fejemis.told import Told
from omnibot_driver.core.fejemis.translation import Translation
from omnibot_driver.core.fejemis.upkeep import Upkeep
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import Reading
from omnibot_driver.core.traits import Traits


class FejemisBoard(Board):
    """A Fejemis robot as a ``Board``, the driver's interface to every robot.

    * ``services``: the requests that only a Fejemis has, such as brush and lift.
    * ``settings``: may be replaced at any time.
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

    # State

    @property
    def traits(self) -> Traits:  # type: ignore[override]
        """The robot's traits, which name each port after the board that was found at this port."""
        return self._ports.traits

    @property
    def settings(self) -> FejemisSettings:
        """The user's settings."""
        return self._settings

    @settings.setter
    def settings(self, settings: FejemisSettings) -> None:
        self._settings = self._encoder.settings = settings
        self._translation.configure(settings)
        self._ports.configure(settings)
        self._upkeep.configure(settings)

    @property
    def mode(self) -> Mode:
        """The mode: nominal while both boards send data and the drive board obeys."""
        return self._inbound.mode

    @property
    def geometry(self) -> Geometry:
        """Track and wheelbase in m that the drive board uses.

        Until the board has reported them, they come from the settings.
        """
        return self._upkeep.geometry

    @property
    def front_angle_rad(self) -> float | None:
        """Angle of the front wheel in rad, limited to ±90°; None if unknown, too old or faulty."""
        front = self._translation.front
        return front.drives_by_rad if front.known(self._now) else None

    @property
    def with_sums(self) -> bool:
        """Whether the text lines to both boards carry checksums."""
        return self._ports.with_sums

    @property
    def driving(self) -> bool:
        """Whether a motion is commanded."""
        return self._actuator is not None and self._actuator.driving

    @property
    def refusal(self) -> str:
        """The reason why the robot must not be driven; empty if driving is allowed."""
        if self._upkeep.jobs.powering_off:
            return POWER_ENDS
        if job := self._upkeep.jobs.at_rest:
            return job
        watch, follower = self._inbound.watch, self._encoder.follower
        return watch.refusal or self._upkeep.pending or follower.refusal

    @property
    def start_refusal(self) -> str:
        """Why the drive board cannot be started (a latched e-stop); empty if it can be started."""
        if self._obedience.estopped:
            return "the e-stop is latched; release it with ~/estop (data: false), then call again"
        return ""

    @property
    def advice(self) -> str | None:
        """Advice on what the user should check; None if nothing is wrong."""
        return self._upkeep.advice

    @property
    def figures(self) -> BoardFigures:
        """Counters and other values for diagnostics; the counters continue over all connections."""
        source = self._obedience.source
        return shown.figures(self._ports, self._upkeep, self._translation, source, self.refusal)

    # Inbound

    def connect(self) -> None:
        """Begin new connections: switch off the brush and the lift, and configure both boards."""
        self._now = -math.inf
        self._ports.begin(self._settings)
        self._translation.connect()
        self._encoder.begin()
        self._upkeep.begin()
        self._inbound.begin()
        self._obedience.begin()

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """Decode ``data``, and return the readings from its complete lines."""
        self._open(now)
        self._inbound.receive(data, now, channel)
        self._inbound.look(now, driving=self.driving)
        return self._taken(now)

    def flush(self, now: float) -> list[Reading]:
        """Discard incomplete lines, because the ports are closed.

        The running job ends as failed.
        """
        self._open(now)
        for half in self._ports.halves:
            half.decoder.flush(now)
        self._upkeep.jobs.begin()
        return self._taken(now)

    def silence(self) -> None:
        """Handle the silence of both boards.

        Switch off brush and lift. Subscribe to all data streams again.
        """
        self._inbound.mode = Mode.UNKNOWN
        for half in self._ports.halves:
            half.subscribe_again()
        self._upkeep.machine.off()

    def stalled(self) -> None:
        """Switch off the brush and the lift, because the driver has stalled.

        The guard may have switched off the brush and the lift already. The stall is not regarded as
        silence of the boards.
        """
        self._inbound.watch.stalled()
        for half in self._ports.halves:
            half.clock.stalled()
        self._translation.stalled()
        if self._upkeep.machine.active:
            self._upkeep.machine.off()

    def leave(self) -> None:
        """Switch off the brush and the lift, and end the running job, because the driver ends.

        This method does not wait until the wheels have stopped.
        """
        self._upkeep.leave()

    def elapse(self, now: float) -> list[Reading]:
        """Check the timeouts, and return the readings that result, such as notices for the user."""
        self._open(now)
        self._inbound.look(now, driving=self.driving)
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

    def _angle_told(self, angle_rad: float, now: float) -> bool:
        return self._actuator is not None and self._actuator.angle_told(angle_rad, now)

    def remark(self, text: str) -> None:
        """Queue a notice for the user that is shown only once."""
        self._told.remark(text)

    def reset_odometry(self) -> None:
        """Do nothing, because the driver keeps the origin of the odometry itself.

        The board's own command ``enc0`` would look like a restart of the board.
        """

    # Outbound

    def actuator(self, proof: StopProof) -> PairStream:
        """Create the actuator: the stream that repeats each set-point to both boards."""
        self._actuator = PairStream(self._encoder, proof, self)
        return self._actuator

    def wanted(self, *, estop: bool) -> None:
        """Latch or release the e-stop, according to a new order of the driver.

        ``estop``: whether the order is an emergency stop, which also switches off the brush and the
        lift. Any other order releases the e-stop.
        """
        if not estop:
            self._obedience.release(self._now)
        elif not self._obedience.estopped:
            self._upkeep.machine.off()
            self._obedience.latch(running=self.mode is Mode.NOMINAL)
            why = "the e-stop was latched during the request; release it, then call again"
            self._upkeep.jobs.interrupt(why)

    def motion(self, drive: bytes, front: bytes) -> Packets:
        """Return the packets that send one motion line to each of the two boards.

        ``drive``: the line for the drive board. ``front``: the line for the front board.
        """
        return self._ports.line("drive", drive) + self._ports.line("front", front)

    def stop(self) -> Packets:
        """Return the packets that send the Stop line, ``rc 2 0 0``, to both boards."""
        return self._ports.both(STOP)

    def emergency_stop(self) -> Packets:
        """Return ``stop`` for the drive board, and lines that switch off the brush and the lift.

        The brush and the lift belong to the front board, which does not know the command ``stop``.
        """
        return self._ports.ending("drive", b"stop") + self._all_off()

    def _all_off(self) -> Packets:
        return self._ports.ending("front", *OFF)

    def switch_off(self) -> Packets:
        """Return lines that switch off the brush and the lift.

        If the user has set the colour of the LED strip, the lines also let the front board show its
        own lights again.
        """
        return self._ports.ending("front", *self._upkeep.machine.switch_off())

    def wake(self) -> Packets:
        """Return a Stop for both boards, and the lines that switch off the lift and the brush."""
        return self.stop() + self._all_off()

    def start_requested(self) -> None:
        """Forget the faults of the front wheel, and cancel a requested power-off.

        The driver calls this method whenever it accepts a call of ~/start, even during an e-stop.
        """
        self._encoder.follower.start()
        self._upkeep.jobs.keep_power()

    def start(self) -> Packets:
        """Return a Stop and then ``start``; return no packets during an e-stop.

        Stop comes first, because after ``start`` the board may obey its last motion command again.
        """
        if self._obedience.estopped:
            return NO_PACKETS
        self._obedience.pause_said = False
        return self.stop() + self._ports.line("drive", b"start")

    def pause(self) -> Packets:
        """Return the packets that stop the motion and pause the drive board.

        The packets also switch brush and lift off.
        """
        self._obedience.pause()
        self._upkeep.jobs.interrupt("the robot was paused during the request; call again")
        self._upkeep.machine.off()
        return self.stop() + self.emergency_stop()

    def force_pause(self) -> Packets:
        """Return the packets of ``pause``. They pause the board in any mode."""
        return self.pause()

    def last_words(self) -> tuple[Packets, Packets]:
        """Return the packets that the guard sends if the driver fails: without and with e-stop.

        Both items contain Stop, and switch the brush and the lift off.
        """
        return self.wake(), self.emergency_stop() + self.stop()

    @property
    def wake_at(self) -> float:
        """Time in s at which to call ``due`` or ``elapse`` next."""
        if self._inbound.relay_rad is not None or self._told.notices or self._upkeep.jobs.done:
            return -math.inf
        wake_at = min(self._upkeep.wake_at, self._obedience.start_at)
        if self._upkeep.machine.active:
            wake_at = min(wake_at, self._inbound.watch.front_unheard_at)
        return min(wake_at, self._inbound.watch.wake_at) if self.mode is Mode.NOMINAL else wake_at

    def due(self, now: float) -> Packets:
        """Return the packets to send now: front wheel's angle, ``start``, packets of ``Upkeep``."""
        packets = NO_PACKETS
        if (angle_rad := self._inbound.take_relay()) is not None:
            text = self._relay.text(angle_rad, sums=self.with_sums)
            packets = self._ports.line("drive", text)
        if self._obedience.start_due(now):
            packets += self._ports.line("drive", b"start")
        return packets + self._upkeep.due(now, stands=not self.driving)
