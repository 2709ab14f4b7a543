"""Every parameter of the driver: name, default, unit, range, meaning; and what they add up to.

The one table from which the node declares, checks and documents. It knows no ROS; types are
plain Python's. Wrong values are ParameterErrors that name the parameter and what it may be.
"""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from omnibot_driver.core.board import Vector3
from omnibot_driver.core.commands import CommandSettings
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.imu import (
    ACCEL_COUNTS_PER_G,
    GYRO_COUNTS_PER_DPS,
    STANDARD_GRAVITY,
    ImuScale,
)
from omnibot_driver.core.inertial import ImuCorrection
from omnibot_driver.core.limits import SpeedLimits
from omnibot_driver.core.odometry import OdometrySettings
from omnibot_driver.core.omnibot import OmniBotSettings
from omnibot_driver.core.plausibility import MotionLimits
from omnibot_driver.core.session import SessionSettings
from omnibot_driver.core.uncertainty import OdometryNoise

Value = bool | int | float | str | list[int] | list[float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One row of the table. The default's type is the parameter's type.

    ``low`` and ``high`` are inclusive, for each number of a list; ``fixed`` means: given at start,
    read-only afterwards. A list is of three, signs where the default's are integers.
    """

    name: str
    default: Value
    unit: str
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[int | str, ...] = ()
    fixed: bool = False

    @property
    def allowed(self) -> str:
        """The allowed values in words; empty when any value of the type will do."""
        if self.choices:
            return "one of " + ", ".join(map(str, self.choices))
        if self.low is not None:
            each = "each " if isinstance(self.default, list) else ""
            return f"{each}{self.low:.10g} to {self.high:.10g} {self.unit}".rstrip()
        return ""

    def check(self, value: object) -> Value:
        """The value in the parameter's own type. Raises ParameterError."""
        if isinstance(self.default, float) and type(value) is int:
            value = float(value)
        elif type(self.default) is int and isinstance(value, float) and value.is_integer():
            value = int(value)
        elif isinstance(self.default, list) and not isinstance(value, str | bytes):
            value = list(value) if isinstance(value, Iterable) else value
        if type(value) is not type(self.default):
            raise self._refusal(value, f"a value of type {type(self.default).__name__}")
        if isinstance(value, list):
            return self._check_three(value)
        assert isinstance(value, bool | int | float | str)
        if self.choices and value not in self.choices:
            raise self._refusal(value, self.allowed)
        if not self._in_range(value):
            raise self._refusal(value, self.allowed)
        if self.name.endswith("_frame") and (not value or str(value).startswith("/")):
            raise self._refusal(value, "a frame name without a leading slash")
        if self.name == "frame_prefix" and str(value).startswith("/"):
            raise self._refusal(value, "a prefix without a leading slash, such as robot1/")
        return value

    def _check_three(self, value: list[Any]) -> list[int] | list[float]:
        assert isinstance(self.default, list)
        if type(self.default[0]) is int:
            if len(value) != 3 or any(item not in (1, -1) for item in value):
                raise self._refusal(value, "three numbers, each 1 or -1")
            return [int(item) for item in value]
        numbers = all(type(item) in (int, float) for item in value)
        if len(value) != 3 or not numbers or not all(map(self._in_range, value)):
            raise self._refusal(value, f"three numbers, {self.allowed}")
        return [float(item) for item in value]

    def _in_range(self, value: bool | int | float | str) -> bool:
        if self.low is None or self.high is None or isinstance(value, str):
            return True
        return self.low <= value <= self.high

    def _refusal(self, value: object, wanted: str) -> ParameterError:
        return ParameterError(f"parameter '{self.name}' must be {wanted}, not {value!r}")


_SPEED: Final = 10.0

PARAMETERS: Final = (
    Parameter(
        "port",
        "/dev/ttyUSB0",
        "",
        "Serial device, or any pyserial URL such as socket://host:port; sim:// is a simulated board"
        " inside the driver, replay://bag a recorded wire.",
        fixed=True,
    ),
    Parameter(
        "baudrate",
        115200,
        "baud",
        "Speed of the serial line.",
        low=1200,
        high=4_000_000,
        fixed=True,
    ),
    Parameter(
        "auto_start",
        True,
        "",
        "Start the board (S) whenever it is there and not running.",
        fixed=True,
    ),
    Parameter(
        "on_exit",
        "stop",
        "",
        "What the board is left in when the driver ends; the robot is stopped in any case.",
        choices=("stop", "pause", "reset"),
    ),
    Parameter(
        "reconnect_interval",
        0.5,
        "s",
        "Time until a lost port is opened again; it grows by half with each failure, to 2 s.",
        low=0.05,
        high=60.0,
    ),
    Parameter(
        "control_method",
        "velocity",
        "",
        "Where the board's own switch stands: whether it takes velocities (cmd_vel, wheel_cmd) or"
        " poses to drive to (cmd_pose).",
        choices=("velocity", "position"),
        fixed=True,
    ),
    Parameter(
        "guard",
        True,
        "",
        "Have a small process of its own stop the robot when the driver is killed or hangs.",
        fixed=True,
    ),
    Parameter(
        "publish_raw",
        False,
        "",
        "Publish what every read and every write of the port brought, on ~/raw_rx and ~/raw_tx: a"
        " bag then holds the wire itself, and replay:// plays it.",
        fixed=True,
    ),
    Parameter(
        "linear_scale",
        70.0,
        "LSB/(m/s)",
        "Command unit of the board for linear speed (and for the rim speed of a wheel).",
        low=1.0,
        high=10_000.0,
    ),
    Parameter(
        "angular_scale",
        500.0,
        "LSB/(rad/s)",
        "Command unit of the board for the yaw rate.",
        low=1.0,
        high=100_000.0,
    ),
    Parameter(
        "position_scale",
        1000.0,
        "LSB/m",
        "Command unit of the board for a position to drive to.",
        low=1.0,
        high=100_000.0,
    ),
    Parameter(
        "heading_scale",
        1000.0,
        "LSB/rad",
        "Command unit of the board for a heading to turn to.",
        low=1.0,
        high=100_000.0,
    ),
    Parameter(
        "max_linear_speed",
        0.5,
        "m/s",
        "Longest linear velocity that is commanded; longer ones keep their direction.",
        low=0.0,
        high=_SPEED,
    ),
    Parameter(
        "max_angular_speed",
        0.5,
        "rad/s",
        "Largest yaw rate that is commanded.",
        low=0.0,
        high=_SPEED,
    ),
    Parameter(
        "max_wheel_speed",
        17.0,
        "rad/s",
        "Rate of the fastest wheel that wheel_cmd may command; the others keep their ratio.",
        low=0.0,
        high=200.0,
    ),
    Parameter(
        "max_linear_acceleration",
        0.0,
        "m/s²",
        "How fast cmd_vel may change the linear velocity, as a vector; 0 is at once. A command to"
        " stand still is never slowed, wheel_cmd neither.",
        low=0.0,
        high=100.0,
    ),
    Parameter(
        "max_angular_acceleration",
        0.0,
        "rad/s²",
        "Likewise, for the yaw rate.",
        low=0.0,
        high=1000.0,
    ),
    Parameter(
        "cmd_vel_timeout",
        0.5,
        "s",
        "Age at which cmd_vel and wheel_cmd are worth nothing and the robot is stopped.",
        low=0.05,
        high=10.0,
    ),
    Parameter(
        "command_rate",
        20.0,
        "Hz",
        "How often the current command, or the emergency stop, is repeated.",
        low=1.0,
        high=50.0,
    ),
    Parameter(
        "enable_stamped_cmd_vel",
        False,
        "",
        "Take geometry_msgs/TwistStamped on cmd_vel instead of geometry_msgs/Twist.",
        fixed=True,
    ),
    Parameter(
        "axis_signs",
        [1, 1, 1],
        "",
        "1 or -1 for x, y and yaw, applied to commands and to odometry.",
        fixed=True,
    ),
    Parameter(
        "delta_frame",
        "earth",
        "",
        "What the board's odometry deltas are: differences of two positions in its earth frame,"
        " motion along its own axes, or (older firmware) counts of its wheels.",
        choices=("earth", "body", "wheel_counts"),
        fixed=True,
    ),
    Parameter(
        "use_board_pose",
        True,
        "",
        "Let the board's own pose settle lost motion and rounding; otherwise only its first"
        " heading is taken.",
    ),
    Parameter(
        "pose_byte_order",
        "big",
        "",
        "Byte order of the floats in the board's pose.",
        choices=("big", "little"),
        fixed=True,
    ),
    Parameter("odom_frame", "odom", "", "Frame that the odometry is given in.", fixed=True),
    Parameter("base_frame", "base_link", "", "Frame that the odometry moves.", fixed=True),
    Parameter("imu_frame", "imu_link", "", "Frame of the IMU's axes.", fixed=True),
    Parameter(
        "frame_prefix",
        "",
        "",
        "Put before every frame name as it is, like robot_state_publisher's; for example robot1/.",
        fixed=True,
    ),
    Parameter(
        "publish_tf",
        True,
        "",
        "Publish the transform from odom_frame to base_frame on /tf; false with an EKF that does.",
        fixed=True,
    ),
    Parameter(
        "wheel_radius",
        0.029,
        "m",
        "Radius of a wheel, for wheel_cmd and for odometry from wheel counts.",
        low=0.001,
        high=1.0,
    ),
    Parameter(
        "base_radius",
        0.143,
        "m",
        "From the centre of the robot to a wheel, for odometry from wheel counts and covariance.",
        low=0.01,
        high=10.0,
    ),
    Parameter(
        "counts_per_revolution",
        1560,
        "counts",
        "Encoder counts of one turn of a wheel, for odometry from wheel counts.",
        low=1,
        high=1_000_000,
    ),
    Parameter(
        "fastest_linear_speed",
        2.0,
        "m/s",
        "What the robot can never exceed, pushed by hand too: no faster displacement and no pose"
        " further away is believed, no correction of odom is faster.",
        low=0.1,
        high=_SPEED,
    ),
    Parameter(
        "fastest_angular_speed",
        8.0,
        "rad/s",
        "Likewise, for turning.",
        low=0.1,
        high=100.0,
    ),
    Parameter(
        "fastest_linear_acceleration",
        15.0,
        "m/s²",
        "What the robot can never exceed, bumped too: a displacement that leaps further and is back"
        " with the next is refused.",
        low=0.1,
        high=1000.0,
    ),
    Parameter(
        "fastest_angular_acceleration",
        50.0,
        "rad/s²",
        "Likewise, for turning; for single leaps of the gyro too.",
        low=1.0,
        high=10_000.0,
    ),
    Parameter(
        "largest_force_step",
        4.0,
        "m/s²",
        "A single leap of one axis of the accelerometer that is larger, of the size of a changed"
        " bit, and back with the next reading, is refused.",
        low=0.1,
        high=1000.0,
    ),
    Parameter(
        "accel_range",
        2,
        "g",
        "Full scale that the accelerometer is set to.",
        choices=tuple(ACCEL_COUNTS_PER_G),
        fixed=True,
    ),
    Parameter(
        "gyro_range",
        250,
        "°/s",
        "Full scale that the gyro is set to.",
        choices=tuple(GYRO_COUNTS_PER_DPS),
        fixed=True,
    ),
    Parameter(
        "gyro_bias",
        [0.0, 0.0, 0.0],
        "rad/s",
        "What the gyro reads at rest, in its own axes; taken off. The service ~/calibrate_gyro"
        " finds it.",
        low=-1.0,
        high=1.0,
    ),
    Parameter(
        "accel_bias",
        [0.0, 0.0, 0.0],
        "m/s²",
        "What the accelerometer reads too much, in its own axes; taken off.",
        low=-5.0,
        high=5.0,
    ),
    Parameter(
        "auto_gyro_bias",
        False,
        "",
        "Refine the gyro's bias slowly whenever the robot stands still. Not where the floor turns.",
    ),
    Parameter(
        "calibration_file",
        "",
        "",
        "YAML file that ~/calibrate_gyro writes; the gyro_bias and accel_bias in it replace those"
        " given here.",
        fixed=True,
    ),
    Parameter(
        "linear_acceleration_stddev",
        0.028,
        "m/s²",
        "Noise of one accelerometer sample (400 µg/√Hz over 50 Hz), for the covariance.",
        low=1e-6,
        high=100.0,
    ),
    Parameter(
        "angular_velocity_stddev",
        0.00087,
        "rad/s",
        "Noise of one gyro sample (0.05 °/s rms), for the covariance.",
        low=1e-6,
        high=100.0,
    ),
    Parameter(
        "odom_wheel_drift",
        0.0035,
        "m/√m",
        "Standard deviation of a wheel's way after 1 m; it grows with the root of the way.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "odom_wheel_scale",
        0.01,
        "m/m",
        "Standard deviation of a wheel's relative size error; it counts for the whole way.",
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "odom_wheel_slip",
        0.02,
        "m/m",
        "Mean part of the way that slip takes from all wheels alike; it counts for the whole way.",
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "odom_gap_acceleration",
        1.0,
        "m/s²",
        "How hard the robot may speed up and brake while its odometry frames are lost.",
        low=0.0,
        high=100.0,
    ),
    Parameter(
        "odom_gap_angular_acceleration",
        5.0,
        "rad/s²",
        "Likewise, for turning.",
        low=0.0,
        high=1000.0,
    ),
    Parameter(
        "twist_linear_stddev",
        0.02,
        "m/s",
        "Noise of the measured linear velocity, for the covariance.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "twist_angular_stddev",
        0.025,
        "rad/s",
        "Noise of the measured yaw rate, for the covariance.",
        low=1e-6,
        high=10.0,
    ),
)

BY_NAME: Final = {parameter.name: parameter for parameter in PARAMETERS}


def check_all(given: Mapping[str, object]) -> dict[str, Value]:
    """Every parameter's value, from those given and the defaults. Raises ParameterError."""
    for name in given:
        if name not in BY_NAME:
            nearest = difflib.get_close_matches(name, BY_NAME, n=1, cutoff=0.0)[0]
            raise ParameterError(
                f"there is no parameter '{name}'; the nearest is '{nearest}'"
                " (config/driver.yaml has them all)"
            )
    values = {
        parameter.name: parameter.check(given.get(parameter.name, parameter.default))
        for parameter in PARAMETERS
    }
    _require_a_frame_for_goals(values)
    return values


def _require_a_frame_for_goals(values: Mapping[str, Any]) -> None:
    """A mirror turns the other way; signs that say otherwise leave positions without meaning."""
    x, y, yaw = values["axis_signs"]
    if values["control_method"] == "position" and x * y != yaw:
        raise ParameterError(
            f"parameter 'axis_signs' must not be {values['axis_signs']} with control_method"
            " 'position': the sign of yaw must be that of x times that of y"
        )


def board_settings(values: Mapping[str, Any]) -> OmniBotSettings:
    """What the board's translator needs of checked values."""
    return OmniBotSettings(
        baudrate=values["baudrate"],
        linear_scale=values["linear_scale"],
        angular_scale=values["angular_scale"],
        position_scale=values["position_scale"],
        heading_scale=values["heading_scale"],
        wheel_radius_m=values["wheel_radius"],
        base_radius_m=values["base_radius"],
        counts_per_revolution=values["counts_per_revolution"],
        delta_frame=values["delta_frame"],
        pose_byte_order=values["pose_byte_order"],
        imu=ImuScale(accel_range_g=values["accel_range"], gyro_range_dps=values["gyro_range"]),
    )


def session_settings(values: Mapping[str, Any]) -> SessionSettings:
    """What the session needs of checked values."""
    return SessionSettings(
        limits=SpeedLimits(
            linear_mps=values["max_linear_speed"],
            angular_radps=values["max_angular_speed"],
            wheel_radps=values["max_wheel_speed"],
            linear_mps2=values["max_linear_acceleration"],
            angular_radps2=values["max_angular_acceleration"],
        ),
        commands=CommandSettings(
            timeout_s=values["cmd_vel_timeout"], rate_hz=values["command_rate"]
        ),
        odometry=OdometrySettings(
            noise=OdometryNoise(
                wheel_drift=values["odom_wheel_drift"],
                wheel_scale=values["odom_wheel_scale"],
                wheel_slip=values["odom_wheel_slip"],
                base_radius_m=values["base_radius"],
                unheard_mps2=values["odom_gap_acceleration"],
                unheard_radps2=values["odom_gap_angular_acceleration"],
            ),
            use_board_pose=values["use_board_pose"],
            fastest_mps=values["fastest_linear_speed"],
            fastest_radps=values["fastest_angular_speed"],
        ),
        motion=MotionLimits(
            fastest_mps=values["fastest_linear_speed"],
            fastest_radps=values["fastest_angular_speed"],
            fastest_mps2=values["fastest_linear_acceleration"],
            fastest_radps2=values["fastest_angular_acceleration"],
            force_step_mps2=values["largest_force_step"],
            full_scale_mps2=values["accel_range"] * STANDARD_GRAVITY,
        ),
        imu=ImuCorrection(
            gyro_bias=_vector(values["gyro_bias"]),
            accel_bias=_vector(values["accel_bias"]),
            auto_gyro_bias=values["auto_gyro_bias"],
        ),
    )


def _vector(numbers: list[float]) -> Vector3:
    x, y, z = numbers
    return x, y, z
