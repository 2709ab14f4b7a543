# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The front Teensy: the steered wheel and its angle sensor, brush, lift, LEDs, infrared sensors.

This module must not know the drive Teensy.
"""

from collections.abc import Callable
from dataclasses import replace
from math import atan2, copysign, cos, degrees, radians
from random import Random

from omnibot_driver.simulator.common.casts import to_int32
from omnibot_driver.simulator.fejemis import wire
from omnibot_driver.simulator.fejemis.config import FrontConfig
from omnibot_driver.simulator.fejemis.help_text import FRONT_HELP
from omnibot_driver.simulator.fejemis.settings import WHEEL_BASE_M, FejemisSettings
from omnibot_driver.simulator.fejemis.teensy import STEP_S, Teensy
from omnibot_driver.simulator.fejemis.vehicle import SERVO_FULL, Vehicle

HEALTHY = 0x3C2
LEDS = 12
MOST_VOLTS = 12.0
IR_FAR_M = 0.99
LED_DEFAULT = (0, 20, 0)


class FrontTeensy(Teensy[FrontConfig]):
    """The simulated front Teensy.

    ``wanted_deg``: angle that the steered wheel must reach; None before the first ``rc`` command.

    Faults of the angle sensor, which the caller may set:

    * ``diagnosis``, ``error_flags``: status bits of the ``fwl`` line, without the frame counter.
    * ``frozen``: the sensor repeats its last angle.
    * ``absent``: no sensor answers, and the Teensy reports the angle 0.
    """

    version = 100
    help_text = FRONT_HELP

    def __init__(self, settings: FejemisSettings, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.diagnosis, self.error_flags = HEALTHY, 0
        self.frozen = self.absent = False
        self._random = Random(f"fejemis angle {settings.seed}")
        self._measured_deg = 0.0
        super().__init__(
            settings,
            1,
            FrontConfig(
                number=settings.ids[1],
                confs_m=(WHEEL_BASE_M, settings.steer_base_m),
                angle_offset_deg=settings.sensor_zero_deg,
            ),
        )

    def boot(self) -> None:
        """Reset the state: brush and lift are off, and the wheel stays where it is."""
        self.wanted_deg: float | None = None
        self._error_deg = self._lead_deg = 0.0
        self.vehicle.servo.command = 0.0
        self.vehicle.brush = False
        self.vehicle.lift.volts = 0.0
        self._lift_until_ms = 0.0
        self._pwm_hz = 15000
        self._servo_raw: float | None = None
        self._jog = (0, 0, 0)
        self.leds = [LED_DEFAULT] * LEDS
        self.leds_on = True
        self._frames = 0

    # Each cycle

    def cycle(self) -> None:
        """Run one cycle: measure the angle, stop the lift if its time is over, and steer."""
        self._measured_deg = self._measure()
        if self.hung:
            return
        if self._lift_until_ms and self._cycles >= self._lift_until_ms:
            self.vehicle.lift.volts, self._lift_until_ms = 0.0, 0.0
        self._steer()

    def _measure(self) -> float:
        if self.absent:
            return 0.0
        if self.frozen:
            return self._measured_deg
        true_deg = self.vehicle.servo.angle_deg
        seen_deg = true_deg + self.settings.sensor_zero_deg - self.config.angle_offset_deg
        return -seen_deg if self.config.angle_inverted else seen_deg

    def _steer(self) -> None:
        """Set the speed of the servo with the P-Lead controller ``Kp (tz s + 1) / (tp s + 1)``."""
        servo, gains = self.vehicle.servo, self.config.steering
        if self._servo_raw is not None:
            servo.command = self._servo_raw
            return
        if self.wanted_deg is None or not gains[0]:
            servo.command = 0.0
            return
        error = self.wanted_deg - self._measured_deg
        if gains[6] and gains[8] > 0.0:
            tz, tp = gains[7], gains[8]
            change = (error - self._error_deg) / STEP_S
            self._lead_deg += (error + tz * change - self._lead_deg) * STEP_S / (tp + STEP_S)
        else:
            self._lead_deg = error
        self._error_deg = error
        limit = gains[16] if gains[15] else SERVO_FULL
        servo.command = max(-limit, min(limit, gains[1] * self._lead_deg))

    # What the Teensy sends

    def items(self) -> dict[str, Callable[[], str]]:
        """Return, for each line that the host can request, the function that writes the line.

        The keys are the lines' names in the help text.
        """
        return super().items() | {
            "hbt": lambda: (
                f"hbt {self.clock_text(4)} {self.config.number} {self.version} 0.00 1 0.011"
            ),
            "mot": lambda: f"mot {self.vehicle.lift.volts:.2f} 0 0 0 0 {self._pwm_hz}",
            "adc": lambda: "adc 0 2050 {} {} 0".format(*self._ir_raw()),
            "int": lambda: f"int {self._cycles} {self._cycles}",
            "bat": lambda: "bat 0.00 0.000 0",
            "time": lambda: "time 1000 90 140 190 320 3",
            "cur": lambda: f"cur {0.2 * abs(self.vehicle.lift.volts):.3f} 2050 0 0.0125 2048 2048",
            "ir": self._infrared,
            "svp": lambda: f"svp {512 + self.vehicle.servo.angle_deg / 0.325:.0f}",
            "svjt": lambda: "svjt {} {} {}".format(*self._jog),
            "fwl": self._angle,
            "fwo": lambda: (
                f"fwo {self.config.angle_offset_deg:.2f} {int(self.config.angle_inverted)}"
            ),
            "cvsteer": self._control_values,
            "cpsteer": lambda: "cpsteer " + " ".join(f"{x:g}" for x in self.config.steering),
            "confs": lambda: "confs {1:.4f} {0:.4f}".format(*self.config.confs_m),
        }

    def _angle(self) -> str:
        frames, self._frames = self._frames, self._frames + 1
        # An absent sensor looks like a sensor that has not finished its first measurement.
        healthy = self.diagnosis & ~0x2 if self.absent else self.diagnosis
        noise = self.settings.angle_noise_deg
        shown = self._measured_deg
        if not (self.frozen or self.absent) and noise:
            shown += self._random.gauss(0.0, noise)
        bits = healthy | (frames // 2 % 2) << 12
        return f"fwl {shown:.2f} 0x{self.error_flags:x} 0x{bits:x}"

    def _control_values(self) -> str:
        wanted = self.wanted_deg or 0.0
        numbers = (wanted, self._measured_deg, wanted - self._measured_deg)
        return "cvsteer {:.3f} {:.3f} {:.3f} {:.1f}".format(*numbers, self.vehicle.servo.command)

    def _ir_m(self) -> float:
        truth = self.vehicle.truth
        facing = cos(truth.yaw_rad)
        wall_m = (self.settings.front_m - truth.x_m) / facing if facing > 0.1 else IR_FAR_M
        return min(IR_FAR_M, max(0.05, wall_m))

    def _ir_raw(self) -> tuple[int, int]:
        a1, b1, a2, b2 = self.config.ir
        inverse = 1.0 / self._ir_m()
        part = (inverse - 2.0) / (1.0 / 0.13 - 2.0)
        return round(b1 + (a1 - b1) * part), round(b2 + (a2 - b2) * part)

    def _infrared(self) -> str:
        distance_m, raw = self._ir_m(), self._ir_raw()
        cal = "{:.0f} {:.0f} {:.0f} {:.0f}".format(*self.config.ir)
        return "irc {:.3f} {:.3f} {} {} {}".format(distance_m, distance_m, *raw, cal)

    # What the Teensy obeys

    def commands_table(self) -> dict[str, Callable[[str], None]]:
        """Return the functions that execute the commands, by command name (see the help text)."""
        return super().commands_table() | {
            "brush": self._set_brush,
            "ledb": self._set_band,
            "leds": lambda _: self._default_leds(),
            "ledon": self._switch_leds,
            "led": self._set_led,
            "motv": self._set_motor,
            "pwmf": self._set_pwm,
            "enc0": lambda _: None,
            "irc": self._set_ir,
            "svp": lambda _: None,
            "svv": self._set_servo,
            "svat": lambda _: None,
            "svar": lambda _: None,
            "svjt": lambda _: None,
            "svb": lambda _: None,
            "svscan": lambda _: self.say("# servo 253 answers"),
            "pds": lambda _: self.say("# AS5047 ok"),
            "read": lambda _: None,
            "fwoffset": self._set_offset,
            "rc": self._remote_control,
            "cssteer": self._set_gains,
            "confs": self._set_base,
        }

    def _remote_control(self, rest: str) -> None:
        """Set the angle that the wheel must reach: ``atan2(F w, v)``, limited to ±90°.

        ``v``, ``w``: commanded speed and turn rate, both negated first if ``v`` < 0 and the
        firmware is "mirrored". ``F``: distance from the axle to the front wheel.
        """
        _, v, turn_dps = wire.padded(rest, 3)
        sideways = self.config.confs_m[1] * radians(turn_dps)
        if v < 0.0 and self.firmware.reverse == "mirrored":
            v, sideways = -v, -sideways
        theta_deg = degrees(atan2(sideways, v))
        if abs(theta_deg) > 90.0:
            theta_deg = copysign(90.0, theta_deg)
        self._servo_raw = None
        self.wanted_deg = theta_deg

    def _set_brush(self, rest: str) -> None:
        self.vehicle.brush = wire.padded(rest, 1)[0] != 0.0

    def _set_band(self, rest: str) -> None:
        self.leds = [_colour(wire.padded(rest, 3))] * LEDS

    def _default_leds(self) -> None:
        self.leds = [LED_DEFAULT] * LEDS

    def _switch_leds(self, rest: str) -> None:
        self.leds_on = wire.padded(rest, 1)[0] != 0.0

    def _set_led(self, rest: str) -> None:
        number, *colour = wire.padded(rest, 4)
        if 0 <= number < LEDS:
            self.leds[int(number)] = _colour(colour)

    def _set_motor(self, rest: str) -> None:
        volts, time_s = wire.padded(rest, 2)
        self.vehicle.lift.volts = max(-MOST_VOLTS, min(MOST_VOLTS, volts)) if time_s > 0.0 else 0.0
        self._lift_until_ms = self._cycles + 1e3 * time_s if time_s > 0.0 else 0.0

    def _set_pwm(self, rest: str) -> None:
        self._pwm_hz = to_int32(wire.padded(rest, 1)[0])

    def _set_ir(self, rest: str) -> None:
        a1, b1, a2, b2 = wire.padded(rest, 4)
        self.config = replace(self.config, ir=(a1, b1, a2, b2))

    def _set_servo(self, rest: str) -> None:
        self._servo_raw = wire.padded(rest, 2)[0]

    def _set_offset(self, rest: str) -> None:
        offset_deg, inverted = wire.padded(rest, 2)
        self.config = replace(
            self.config, angle_offset_deg=offset_deg, angle_inverted=inverted != 0.0
        )

    def _set_gains(self, rest: str) -> None:
        self.config = replace(self.config, steering=tuple(wire.padded(rest, 17)))

    def _set_base(self, rest: str) -> None:
        base_m, steer_m = wire.padded(rest, 2)
        self.config = replace(self.config, confs_m=(base_m, steer_m))


def _colour(rgb: list[float]) -> tuple[int, int, int]:
    red, green, blue = (max(0, min(255, to_int32(part))) for part in rgb)
    return red, green, blue
