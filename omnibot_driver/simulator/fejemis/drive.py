# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The drive Teensy: control of the driving wheels, odometry, IMU, battery, distance sensors.

This module must not know the front Teensy: the front wheel's angle comes from a command.
"""

from collections.abc import Callable
from dataclasses import replace
from math import cos, degrees, pi, radians, sin

from omnibot_driver.simulator.common.casts import to_int32
from omnibot_driver.simulator.fejemis import wire
from omnibot_driver.simulator.fejemis.config import WHEELS, DriveConfig
from omnibot_driver.simulator.fejemis.distances import Distances
from omnibot_driver.simulator.fejemis.help_text import DRIVE_HELP
from omnibot_driver.simulator.fejemis.imu import Imu
from omnibot_driver.simulator.fejemis.settings import WHEEL_BASE_M, FejemisSettings
from omnibot_driver.simulator.fejemis.teensy import STEP_S, Teensy
from omnibot_driver.simulator.fejemis.vehicle import Vehicle, wheel_speeds

STOPPED, FREE = -1, 10


class DriveTeensy(Teensy[DriveConfig]):
    """The simulated drive Teensy.

    * ``source``: source of the motion commands (rcSource in heartbeats); -1 while stopped.
    * ``reference``: speed in m/s and turn rate in rad/s of the last ``rc`` command.
    * ``told_angle_deg``: angle of the front wheel in the last ``fwl`` command, in degrees.
    * ``off_at_s``: time in s of a requested power-off, or None.
    """

    version = 110
    help_text = DRIVE_HELP
    pose: tuple[float, float, float]
    _last: tuple[int, int]
    off_at_s: float | None

    def __init__(self, settings: FejemisSettings, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.imu = Imu(settings, vehicle)
        self.distances = Distances(settings, vehicle)
        super().__init__(
            settings,
            0,
            DriveConfig(
                number=settings.ids[0],
                radii_m=(settings.wheel_radius_m, settings.wheel_radius_m),
                gear=settings.gear,
                ticks=settings.ticks,
                wheel_base_m=WHEEL_BASE_M,
                confs_m=(WHEEL_BASE_M, settings.steer_base_m),
            ),
        )

    def boot(self) -> None:
        """Reset speeds, pose and sensors, and cancel a requested power-off."""
        self.off_at_s = None
        self.source = FREE
        self.reference = (0.0, 0.0)
        self.told_angle_deg = 0.0
        self.speeds_mps = (0.0, 0.0)
        self.vehicle.wanted_radps = (0.0, 0.0)
        self.vehicle.powered = self._booted
        self._reset_pose()
        self.distances.trigger()
        self.imu.boot()

    def started(self) -> None:
        """Reset the pose at the end of a boot, because the wheels may have turned meanwhile."""
        self._reset_pose()

    # Each cycle

    def cycle(self) -> None:
        """Run one control cycle: power, odometry, IMU and control of the wheels."""
        self.vehicle.powered = True
        if self.off_at_s is not None and self._told_s >= self.off_at_s:
            self.powered = self.vehicle.powered = False
            return
        self._odometry()
        self.imu.cycle(STEP_S, self.config)
        if self.imu.calibrated is not None:
            self.config = replace(self.config, **self.imu.calibrated)
            self.imu.calibrated = None
        if self.hung:
            return
        config = self.config
        if self.source == STOPPED:
            self.speeds_mps = (0.0, 0.0)
        else:
            self.speeds_mps = wheel_speeds(*self.reference, self.told_angle_deg, *config.confs_m)
        left, right = self.speeds_mps
        self.vehicle.wanted_radps = (left / config.radii_m[0], right / config.radii_m[1])

    def _raw_ticks(self) -> tuple[int, int]:
        per_turn = self.settings.gear * self.settings.ticks
        left, right = self.vehicle.turns
        return int(left * per_turn // 1), int(right * per_turn // 1)

    @property
    def ticks(self) -> tuple[int, int]:
        """Ticks of the left and the right encoder since the boot or the last ``enc0`` command."""
        left, right = self._raw_ticks()
        return left - self._ticks_at_boot[0], right - self._ticks_at_boot[1]

    def _metres(self, index: int, ticks: int) -> float:
        config = self.config
        return ticks / (config.gear * config.ticks) * 2 * pi * config.radii_m[index]

    def _odometry(self) -> None:
        ticks = self.ticks
        if ticks == self._last:
            return
        left = self._metres(0, ticks[0] - self._last[0])
        right = self._metres(1, ticks[1] - self._last[1])
        self._last = ticks
        x, y, h = self.pose
        turn = (right - left) / self.config.wheel_base_m
        x += (left + right) / 2 * cos(h + turn / 2)
        y += (left + right) / 2 * sin(h + turn / 2)
        self.pose = (x, y, (h + turn + pi) % (2 * pi) - pi)

    # What the Teensy sends

    def items(self) -> dict[str, Callable[[], str]]:
        """Return, for each line that the host can request, the function that writes the line.

        The keys are the lines' names in the help text.
        """
        return super().items() | {
            "hbt": self._heartbeat,
            "adc": lambda: f"adc {self.settings.volts * 100:.0f} 2050 812 790 0",
            "int": lambda: f"int {self._cycles} {self._cycles}",
            "bat": lambda: (
                f"bat {self.settings.volts:.2f} {self._amps():.3f} {self.settings.cells}"
            ),
            "time": lambda: "time 1000 120 210 260 320 3",
            "amp": lambda: f"amp {self._amps():.3f} 2050 0 0.0125 2048 2048",
            "cvdrive": self._control_values,
            "cpdrive": lambda: "cpdrive " + " ".join(f"{number:g}" for number in WHEELS),
            "confs": lambda: "confs {1:.4f} {0:.4f}".format(*self.config.confs_m),
            "gyro": lambda: "gyro {:.3f} {:.3f} {:.3f}".format(*self.imu.gyro(self.config)),
            "gyroo": lambda: "gyroo {:.4f} {:.4f} {:.4f}".format(*self.config.gyro_offset_dps),
            "acc": self._acceleration,
            "acco": lambda: "acco {:.4f} {:.4f} {:.4f}".format(*self.config.accel_offset_mps2),
            "mag": lambda: "mag {:.2f} {:.2f} {:.2f}".format(*self.imu.mag(self.config)),
            "magw": lambda: "magw {:.2f} {:.2f} {:.2f}".format(*self.imu.mag_raw()),
            "mago": self._mag_offset,
            "imupose": lambda: "imupose {:.4f} {:.4f} {:.4f}".format(*self.imu.orientation),
            "enc": lambda: "enc {} {}".format(*self.ticks),
            "pose": self._pose,
            "vel": self._velocity,
            "conf": self._wheels,
            "tofd": lambda: f"tofd {self.distances.tof_m:.3f}",
            "tof1": lambda: f"tof1 {self.distances.tof_m:.3f}",
            "sr04": lambda: f"sr04 {self.distances.sonar_m:.3f}",
        }

    def _heartbeat(self) -> str:
        source = self.source if self.firmware.shows_source or self.source < 0 else FREE
        return (
            f"hbt {self.clock_text(5)} {self.config.number} {self.version}"
            f" {self.settings.volts:.2f} {source} 0"
        )

    def _amps(self) -> float:
        return 0.42 + 0.8 * sum(abs(speed) for speed in self.speeds_mps)

    def _control_values(self) -> str:
        v, w = self.reference
        numbers = (v, w, self.told_angle_deg, *self.speeds_mps, *self.velocity())
        return "cvdrive " + " ".join(f"{number:.3f}" for number in numbers)

    def _acceleration(self) -> str:
        unit = 9.80665 if self.firmware.acceleration_in_g else 1.0
        numbers = (axis / unit for axis in self.imu.accel(self.config))
        return "acc {:.4f} {:.4f} {:.4f}".format(*numbers)

    def _mag_offset(self) -> str:
        config = self.config
        return "mago " + " ".join(f"{x:.4f}" for x in (*config.mag_offset_ut, *config.mag_matrix))

    def velocity(self) -> tuple[float, float]:
        """Return the speeds of the left and the right wheel in m/s, which are not quantised."""
        (left, right), (left_m, right_m) = self.vehicle.radps, self.config.radii_m
        return left * left_m, right * right_m

    def _velocity(self) -> str:
        time = f"{self.clock_text(4)} " if self.firmware.timed_velocity else ""
        left, right = self.velocity()
        return f"vel {time}{left:.3f} {right:.3f}"

    def _pose(self) -> str:
        tilt = " 0.0000" if self.firmware.tilt else ""
        x, y, h = self.pose
        return f"pose {self.clock_text(5)} {x:.3f} {y:.3f} {h:.4f}{tilt}"

    def _wheels(self) -> str:
        config = self.config
        left, right = config.radii_m
        return (
            f"conf {left:.4f} {right:.4f} {config.gear:.3f} {config.ticks:.0f}"
            f" {config.wheel_base_m:.4f} {STEP_S:.4f}"
        )

    # What the Teensy obeys

    def commands_table(self) -> dict[str, Callable[[str], None]]:
        """Return the functions that execute the commands, by command name (see the help text)."""
        return super().commands_table() | {
            "rc": self._remote_control,
            "fwl": self._front_wheel,
            "confs": self._set_steering,
            "stop": lambda _: self._stop(),
            "start": lambda _: self._start(),
            "off": self._off,
            "on": lambda _: self._on(),
            "gyroc": lambda _: self.imu.calibrate_gyro(),
            "acccal2": lambda _: self.imu.calibrate_accelerometer(),
            "acccal": self._set_accelerometer,
            "magcal": self._set_magnetometer,
            "enc0": lambda _: self._reset_pose(),
            "confw": self._set_wheels,
            "hcsr": lambda _: self.distances.trigger(),
            "log": lambda _: None,
        }

    def _remote_control(self, rest: str) -> None:
        source, v, turn_dps = wire.padded(rest, 3)
        if self.source == STOPPED:
            if self.firmware.start_resumes:
                self.reference = (v, radians(turn_dps))
            return
        self.source = to_int32(source)
        self.reference = (v, radians(turn_dps))

    def _front_wheel(self, rest: str) -> None:
        (self.told_angle_deg,) = wire.padded(rest, 1)

    def _set_steering(self, rest: str) -> None:
        base_m, steer_m = wire.padded(rest, 2)
        self.config = replace(self.config, confs_m=(base_m, steer_m))

    def _stop(self) -> None:
        self.source = STOPPED
        if not self.firmware.start_resumes:
            self.reference = (0.0, 0.0)

    def _start(self) -> None:
        self.source = FREE

    def _off(self, rest: str) -> None:
        (delay_s,) = wire.padded(rest, 1)
        self.off_at_s = self._told_s + delay_s

    def _on(self) -> None:
        self.off_at_s = None

    def _set_accelerometer(self, rest: str) -> None:
        given = wire.padded(rest, 6)
        self.config = replace(
            self.config,
            accel_offset_mps2=(given[0], given[1], given[2]),
            accel_scale=(given[3], given[4], given[5]),
        )

    def _set_magnetometer(self, rest: str) -> None:
        given = wire.padded(rest, 12)
        self.config = replace(
            self.config, mag_offset_ut=(given[0], given[1], given[2]), mag_matrix=tuple(given[3:])
        )

    def _reset_pose(self) -> None:
        self._ticks_at_boot = self._raw_ticks()
        self._last = (0, 0)
        self.pose = (0.0, 0.0, 0.0)

    def _set_wheels(self, rest: str) -> None:
        left, right, gear, ticks, base_m = wire.padded(rest, 5)
        if left > 0.0 and right > 0.0 and gear > 0.0 and ticks > 0.0 and base_m > 0.0:
            self.config = replace(
                self.config, radii_m=(left, right), gear=gear, ticks=ticks, wheel_base_m=base_m
            )

    @property
    def turn_dps(self) -> float:
        """Turn rate of the last motion command (``rc``), in degrees per second."""
        return degrees(self.reference[1])
