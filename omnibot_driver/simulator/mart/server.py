# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The server: two ports with a thread each, a timer while something moves, and simulated time.

Equal input gives equal output. This module does not know sockets or real time.
"""

from collections import deque
from math import inf
from typing import Any, NamedTuple

from omnibot_driver.simulator.mart import alarms, commands, moves, stop_port, wire
from omnibot_driver.simulator.mart.chassis import STEP_S
from omnibot_driver.simulator.mart.motion import Kind
from omnibot_driver.simulator.mart.settings import MartSettings
from omnibot_driver.simulator.mart.state import COMMAND, STOP, ServerState, Then, Waiter

QUEUE_LENGTH, REMEMBERED = 256, 10_000
QUICK_S = 0.0005
BOOT_S, START_UP_S = 0.3, 0.8
"""``BOOT_S``: time in s from a restart of the program until its ports are open.

``START_UP_S``: time in s from the opening of the ports until the program has started up completely.
"""
UNCONTROLLED = (Kind.LINEAR, Kind.REFERENCE, Kind.SPIN)

Sender = object


class Reply(NamedTuple):
    """A datagram from the server's ``port`` to ``sender``, the sender of a request.

    ``at_s``: when it is sent, in s, by the server's clock ``now_s``.
    """

    at_s: float
    port: int
    sender: Sender
    data: bytes


class _Later(NamedTuple):
    at_s: float
    then: Then
    args: tuple[Any, ...]


class MartServer(ServerState):
    """The controller with its robot. ``receive`` and ``advance`` move the simulated time forward.

    * ``received``: the last datagrams at both ports, each with its time and port.
    * ``executed``: the last commands that the server began.
    """

    def __init__(self, settings: MartSettings | None = None) -> None:
        super().__init__(MartSettings() if settings is None else settings)
        self.received: deque[tuple[float, int, bytes]] = deque(maxlen=REMEMBERED)
        self.executed: deque[str] = deque(maxlen=REMEMBERED)
        self._out: list[Reply] = []
        self._step_at_s = inf
        self._boots_until_s = self._starts_until_s = -inf
        self.begin()

    def begin(self) -> None:
        """Reset all that the program knows, as at its start."""
        super().begin()
        self._sender: Sender = None
        self._later: _Later | None = None
        self._queue: deque[tuple[bytes, Sender]] = deque()
        self._stop_queue: deque[bytes] = deque()

    # From outside

    def receive(self, datagram: bytes, port: int, sender: Sender, now: float) -> None:
        """Receive a datagram at ``now``, in s since construction. ``now`` must never decrease."""
        self._run(now)
        self.received.append((now, port, datagram))
        if self.crashed or now < self._boots_until_s:
            return
        if not datagram:
            if self.quirks.empty_datagram_ends and port == COMMAND:
                self.end("an empty datagram")
            return
        if port == STOP:
            if len(self._stop_queue) < QUEUE_LENGTH:
                self._stop_queue.append(datagram)
            self._hear_stops()
        elif len(self._queue) < QUEUE_LENGTH:
            self._queue.append((datagram, sender))
            self._next()

    def advance(self, now: float) -> list[Reply]:
        """Let time pass until ``now``. Return the replies that were sent since the last call."""
        self._run(now)
        out, self._out = self._out, []
        return out

    @property
    def wake_at(self) -> float:
        """Time in s of the next event, if no datagram comes before; infinity if none is planned."""
        if self._out:
            return self.now_s
        return min(self._step_at_s, inf if self._later is None else self._later.at_s)

    def copy(self) -> "MartServer":
        """Return an independent copy, which continues from here.

        This is faster than a deep copy.
        """
        new = MartServer.__new__(MartServer)
        new.__dict__.update(self.__dict__)
        new.chassis, new.imu = self.chassis.copy(), self.imu.copy()
        new.motions = [motion.copy() for motion in self.motions]
        new.received, new.executed = self.received.copy(), self.executed.copy()
        new.files, new.last_files = {**self.files}, {**self.last_files}
        new.custom = {**self.custom}
        new.log = None if self.log is None else [*self.log]
        new._out, new.waiters = [*self._out], [*self.waiters]
        new._queue, new._stop_queue = self._queue.copy(), self._stop_queue.copy()
        return new

    def restart(self, boot_s: float = BOOT_S) -> None:
        """Restart the server program. The motors keep the last command that they received.

        Datagrams of the next ``boot_s`` seconds are lost. The start-up takes ``START_UP_S`` more
        seconds.
        """
        self.begin()
        self.imu.restart()
        self._boots_until_s = self.now_s + boot_s
        self._starts_until_s = self._boots_until_s + START_UP_S

    @property
    def starts_up(self) -> bool:
        """Whether the program has opened its ports, but has not started up completely."""
        return self.now_s < self._starts_until_s

    def power_cycle(self, boot_s: float = 1.0) -> None:
        """Switch the controller and the motor board off and on. The robot stays where it is."""
        self.chassis.power_cycle()
        self.restart(boot_s)

    @property
    def blocked(self) -> bool:
        """Whether the command port waits for samples of an IMU that does not send any."""
        if self.imu.living(self.now_s) or self.crashed:
            return False
        later = self._later
        return (later is not None and later.then is moves.take_bias) or any(
            waiter.port == COMMAND and waiter.kind is self.alarm and waiter.kind in UNCONTROLLED
            for waiter in self.waiters
        )

    # For commands and motions

    def drive(self, right: int, left: int) -> None:
        """Write the registers of both motors."""
        self.chassis.set(right, left)
        self._wake()

    def watch(self, kind: Kind) -> None:
        """Supervise motions of ``kind``; do nothing if another kind is already supervised."""
        if self.alarm is None:
            self.alarm = kind
        self._wake()

    def later(self, seconds: float, then: Then, *args: Any) -> None:
        """Schedule the next part of the command: ``then(server, *args)`` after ``seconds``."""
        self._later = _Later(self.now_s + seconds, then, args)

    def wait(self, port: int, kind: Kind, then: Then | None, *args: Any) -> None:
        """Call ``then`` when ``post`` reports the next start or end of a motion of ``kind``.

        If ``post`` has kept a report, ``then`` is called at once. ``port``: the waiting command's
        port.
        """
        motion = self.motions[kind]
        if motion.posts:
            motion.posts -= 1
            if then is not None:
                then(self, *args)
        else:
            self.waiters.append(Waiter(port, kind, then, args))

    def post(self, kind: Kind) -> None:
        """Report the start or the end of a motion of ``kind`` to the first port that waits for it.

        If no port waits, the report is kept for the next ``wait``.
        """
        for waiter in self.waiters:
            if waiter.kind is kind:
                self.waiters.remove(waiter)
                if waiter.then is not None:
                    waiter.then(self, *waiter.args)
                if waiter.port == STOP:
                    self._hear_stops()
                return
        self.motions[kind].posts += 1

    def answer(self, text: str) -> None:
        """Reply to the command in progress, and finish it."""
        self.last_reply = text
        self.send(wire.reply(text))
        self.done()

    def send(self, data: bytes) -> None:
        """Send a datagram to the sender of the command in progress."""
        self.write_log(data[:49].decode("latin-1"))
        self._out.append(Reply(self.now_s, COMMAND, self._sender, data))

    def done(self) -> None:
        """Finish the command in progress, and begin the next one."""
        self.busy = False
        self._next()

    def abort(self, text: str) -> None:
        """Give up the motion that is being started, and answer its command with ``text``."""
        kind, self.starting = self.starting, None
        self._later = None
        self.waiters = [waiter for waiter in self.waiters if waiter.port != COMMAND]
        self.alarm = None
        if kind is not None:
            alarms.stop_motors(self, self.motions[kind])
            self.motions[kind].running = self.motions[kind].watching = False
        self.answer(text)

    def end(self, why: str) -> None:
        """End the program for the reason ``why``. The motors keep their last command."""
        self.crashed = why
        self.alarm = self.starting = self._later = None
        self.busy = False
        self.waiters.clear()
        self._queue.clear()
        self._stop_queue.clear()

    def zero_heading(self) -> None:
        """Set the relative heading to zero. The server does this when a forward drive starts."""
        self.imu.drift(self.now_s, integrates=False)
        self.imu.heading_deg = 0.0

    def heading_deg(self) -> float:
        """Return the relative heading in degrees, as RMRA reports it."""
        if self._step_at_s == inf:
            self.imu.drift(self.now_s, integrates=self.heading_integrates)
        return self.imu.heading_deg

    # Time

    def _wake(self) -> None:
        if self._step_at_s == inf:
            self.imu.drift(self.now_s, integrates=self.heading_integrates)
            self._step_at_s = self.now_s + STEP_S

    def _run(self, now: float) -> None:
        while True:
            later, step_s = self._later, self._step_at_s
            if later is not None and later.at_s < step_s:
                if later.at_s > now:
                    break
                self.now_s = max(self.now_s, later.at_s)
                self._later = None
                later.then(self, *later.args)
            elif step_s <= now:
                self.now_s = step_s
                self._step()
            else:
                break
        self.now_s = max(self.now_s, now)

    def _step(self) -> None:
        chassis, now = self.chassis, self.now_s
        rate_dps = chassis.step()
        if self.imu.living(now):
            self.imu.sample(rate_dps, now, integrates=self.heading_integrates)
        else:
            self.imu.drift(now, integrates=False)
        if not -self.rear_m < chassis.x_m < self.front_m:
            self.hit_wall = True
        if self.alarm is not None:
            alarms.sample(self, self.motions[self.alarm])
        if self.alarm is None and chassis.rests:
            self._step_at_s = inf
        else:
            self._step_at_s += STEP_S

    # The two threads

    def _next(self) -> None:
        while self._queue and not self.busy and not self.crashed:
            datagram, self._sender = self._queue.popleft()
            text = wire.text_of(datagram)
            self.busy = True
            self.executed.append(text)
            self.write_log(text)
            answer = commands.execute(self, text)
            if answer is not None:
                self.later(QUICK_S, MartServer.answer, answer)

    def _hear_stops(self) -> None:
        while self._stop_queue and not any(waiter.port == STOP for waiter in self.waiters):
            stop_port.obey(self, wire.text_of(self._stop_queue.popleft()))
