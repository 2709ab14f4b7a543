# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The two simulated Teensys and their robot, which advance in steps of a millisecond.

The simulation is deterministic. Three assumptions are not in the manual:

* A motion command (``rc``) stays in effect until the next one.
* The front wheel does not move before the first motion command.
* A restart ends motion and subscriptions.

The module must not know commands.
"""

from collections.abc import Mapping

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.fejemis.drive import DriveTeensy
from omnibot_driver.simulator.fejemis.faults import allowed
from omnibot_driver.simulator.fejemis.front import FrontTeensy
from omnibot_driver.simulator.fejemis.settings import FejemisSettings
from omnibot_driver.simulator.fejemis.teensy import STEP_S
from omnibot_driver.simulator.fejemis.vehicle import TrueState, Vehicle

CHANNELS = (Channel("drive"), Channel("front", "front_port"))
STEPS_PER_TICK = 2


class SimulatedFejemis:
    """A simulated Fejemis with the common interface of simulated boards.

    ``tick``: number of ticks of 2 ms since construction.
    """

    channels = CHANNELS
    tick_s = STEP_S * STEPS_PER_TICK

    def __init__(self, settings: FejemisSettings | None = None) -> None:
        self.settings = settings = FejemisSettings() if settings is None else settings
        self.tick = 0
        self._steps = 0
        self.vehicle = Vehicle(settings)
        self.drive = DriveTeensy(settings, self.vehicle)
        self.front = FrontTeensy(settings, self.vehicle)
        self._at_port: tuple[DriveTeensy | FrontTeensy, ...] = (self.drive, self.front)
        if settings.swapped:
            self._at_port = (self.front, self.drive)
        self._faults = sorted(settings.faults, key=lambda fault: fault.at_s)

    @property
    def now_s(self) -> float:
        """Simulated time since construction, in s."""
        return self._steps * STEP_S

    @property
    def truth(self) -> TrueState:
        """True pose and motion of the robot."""
        return self.vehicle.truth

    @property
    def standing(self) -> bool:
        """Whether both driving wheels are truly at rest."""
        return self.vehicle.standing

    def half(self, name: str) -> DriveTeensy | FrontTeensy:
        """Return the Teensy named ``drive`` or ``front``."""
        return self.drive if name == "drive" else self.front

    def befall(self, half: str, what: str) -> None:
        """Apply the fault ``what`` to one Teensy now.

        ``what``: the name of a fault in ``faults.py``, such as ``silent``. Raises KeyError if this
        Teensy cannot have the fault.
        """
        allowed(half)[what](self.half(half))

    def receive(self, data: bytes, now: float = 0.0, channel: int = 0) -> None:
        """Receive bytes at one of the two ports."""
        self._at_port[channel].receive(data)

    def advance(self) -> list[Packet]:
        """Advance by one tick; return the bytes that each port sends during this tick."""
        self.tick += 1
        sent: list[bytes] = [b"", b""]
        for _ in range(STEPS_PER_TICK):
            self._steps += 1
            while self._faults and self._faults[0].at_s <= self.now_s:
                fault = self._faults.pop(0)
                self.befall(fault.half, fault.what)
            self.vehicle.advance(STEP_S)
            for channel, half in enumerate(self._at_port):
                sent[channel] += half.step(self.now_s)
            if not self.drive.powered:
                self.front.powered = False
                self.vehicle.servo.command = self.vehicle.lift.volts = 0.0
                self.vehicle.brush = False
        return [(channel, data) for channel, data in enumerate(sent) if data]

    def reboot(self) -> None:
        """Switch both Teensys off and on again. The robot stays where it is."""
        for half in (self.drive, self.front):
            half.powered = True
            half.reboot()

    @property
    def facts(self) -> Mapping[str, object]:
        """Facts about the robot and its boards, by name, for tests and users of the simulator."""
        truth, drive, front, vehicle = self.truth, self.drive, self.front, self.vehicle
        return {
            "x_m": truth.x_m,
            "y_m": truth.y_m,
            "yaw_rad": truth.yaw_rad,
            "speed_mps": truth.speed_mps,
            "yaw_rate_radps": truth.yaw_rate_radps,
            "front_wheel_deg": vehicle.servo.angle_deg,
            "told_angle_deg": drive.told_angle_deg,
            "source": drive.source,
            "brush": vehicle.brush,
            "lift_volts": vehicle.lift.volts,
            "lift_height": vehicle.lift.height,
            "led": list(front.leds[0]),
            "powered": drive.powered,
            "executed": [len(drive.commands), len(front.commands)],
            "unhandled": [drive.unhandled, front.unhandled],
            "subscriptions": {
                "drive": dict(drive.subscriptions),
                "front": dict(front.subscriptions),
            },
        }
