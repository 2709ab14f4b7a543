# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the parameter table.

It agrees with the promised names, with the core and with the parameter file.
"""

import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver import boards, parameters
from omnibot_driver.boards import check_all, omnibot
from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.measurement.outlier_filter import MotionLimits
from omnibot_driver.core.omnibot import OmniBot
from omnibot_driver.parameters import Parameter, session_settings

CONFIG = Path(__file__).parent.parent / "config" / "omnibot.yaml"
FORMER = CONFIG.with_name("driver.yaml")
PROMISED: dict[str, object] = {
    "port": "/dev/ttyUSB0",
    "baudrate": 115200,
    "auto_start": True,
    "on_exit": "stop",
    "reconnect_interval": 0.5,
    "guard": True,
    "linear_scale": 70.0,
    "angular_scale": 500.0,
    "control_method": "velocity",
    "position_scale": 1000.0,
    "heading_scale": 1000.0,
    "max_linear_speed": 0.5,
    "max_angular_speed": 0.5,
    "max_wheel_speed": 17.0,
    "max_linear_acceleration": 0.0,
    "max_angular_acceleration": 0.0,
    "cmd_vel_timeout": 0.5,
    "command_rate": 20.0,
    "enable_stamped_cmd_vel": False,
    "axis_signs": [1, 1, 1],
    "delta_frame": "earth",
    "delta_period": 0.04,
    "pose_byte_order": "big",
    "odom_frame": "odom",
    "base_frame": "base_link",
    "imu_frame": "imu_link",
    "wheel_radius": 0.029,
    "base_radius": 0.143,
    "counts_per_revolution": 1560,
    "use_board_pose": True,
    "accel_range": 2,
    "gyro_range": 250,
    "frame_prefix": "",
    "publish_tf": True,
    "gyro_bias": [0.0, 0.0, 0.0],
    "accel_bias": [0.0, 0.0, 0.0],
    "auto_gyro_bias": False,
    "calibration_file": "",
    "publish_raw": False,
}
"""Names and defaults that users rely on."""


EVERY_ROW = [
    pytest.param(row, id=f"{board}: {row.name}")
    for board in boards.PROFILES
    for row in boards.load(board).PARAMETERS.rows
]
DIMENSIONLESS = {
    "gear", "ir_calibration", "left_feed_forward", "left_kp", "left_long_correction",
    "left_short_correction", "low_pass", "motor_balance", "right_feed_forward", "right_kp",
    "right_long_correction", "right_short_correction", "steering_gains",
}  # fmt: skip
"""Parameters without a unit: pure numbers, and lists whose items have different units."""


def name_of(parameter: object) -> str | None:
    return parameter.name if isinstance(parameter, Parameter) else None


@pytest.mark.parametrize(("name", "default"), PROMISED.items())
def test_every_promised_parameter_is_there_with_its_default(name: str, default: object) -> None:
    """Each parameter that users rely on has the default in ``PROMISED``, of the same type."""
    assert PARAMETERS.by_name[name].default == default
    assert type(PARAMETERS.by_name[name].default) is type(default)


@pytest.mark.parametrize("parameter", EVERY_ROW)
def test_every_default_passes_its_own_check_and_is_explained(parameter: Parameter) -> None:
    """Each parameter has a valid default, and a description that is a sentence.

    A quantity has a unit, and a number has limits or choices.
    """
    value = parameter.check(parameter.default)
    assert value == parameter.default
    assert type(value) is type(parameter.default)
    assert parameter.description.endswith(".")
    assert (parameter.low is None) == (parameter.high is None)
    if parameter.kind is float:
        assert parameter.unit or parameter.name in DIMENSIONLESS, (
            "give it a unit; if it is a pure number, add its name to DIMENSIONLESS in"
            " test/test_parameters.py"
        )
    if parameter.kind in (int, float):
        limited = parameter.low is not None or parameter.choices
        assert limited, "a number without limits lets NaN through"


def test_names_are_unique() -> None:
    """Each parameter name is in the table once. A second row would hide the first one."""
    assert len(PARAMETERS.by_name) == len(PARAMETERS.rows)


@pytest.mark.parametrize("name", ["port", "odom_frame", "base_frame", "imu_frame"])
def test_identity_cannot_change_while_it_runs(name: str) -> None:
    """Port and frames are read-only while the driver runs."""
    assert PARAMETERS.by_name[name].fixed


@pytest.mark.parametrize("name", ["max_linear_speed", "linear_scale", "cmd_vel_timeout"])
def test_tuning_may_change_while_it_runs(name: str) -> None:
    """Tuning parameters can change while the driver runs. Users find their values by trial."""
    assert not PARAMETERS.by_name[name].fixed


def test_what_is_not_given_is_the_default() -> None:
    """A parameter has its default value unless the user gives another."""
    assert check_all({}) == {parameter.name: parameter.initial for parameter in PARAMETERS.rows}
    values = check_all({"max_linear_speed": 1, "port": "/dev/ttyACM3"})
    assert values["max_linear_speed"] == 1.0
    assert values["port"] == "/dev/ttyACM3"
    assert values["baudrate"] == 115200


@pytest.mark.parametrize(
    ("mistyped", "meant"),
    [
        ("max_linear_sped", "max_linear_speed"),
        ("max_linear_speeed", "max_linear_speed"),
        ("Port", "port"),
        ("baud_rate", "baudrate"),
        ("cmd_vel_time_out", "cmd_vel_timeout"),
        ("wheel_diameter", "wheel_radius"),
    ],
)
def test_an_unknown_name_is_refused_with_the_nearest_known_one(mistyped: str, meant: str) -> None:
    """An unknown parameter name is rejected, and the error gives the most similar known name.

    rclpy alone would ignore the unknown name.
    """
    with pytest.raises(ParameterError, match=f"'{mistyped}'.*'{meant}'"):
        check_all({mistyped: 1})


@given(st.text())
def test_any_unknown_name_is_refused(name: str) -> None:
    """Any unknown parameter name is rejected, even if it is similar to a known name, or empty."""
    if name not in PARAMETERS.by_name and not boards.owners_of(name):
        with pytest.raises(ParameterError, match="the nearest is"):
            check_all({name: 1})


def test_one_wrong_value_among_many_is_found() -> None:
    """One wrong value among many is found, and the message names its parameter."""
    with pytest.raises(ParameterError, match="'command_rate'"):
        check_all({"port": "/dev/ttyACM3", "command_rate": 1e6, "baudrate": 9600})


def test_odom_and_base_must_be_different_frames() -> None:
    """``odom_frame`` and ``base_frame`` must differ. Otherwise TF would have a loop.

    The IMU frame may equal the base frame.
    """
    with pytest.raises(ParameterError, match="'odom_frame' must differ from 'base_frame'"):
        check_all({"odom_frame": "base_link"})
    assert check_all({"imu_frame": "base_link"})


@pytest.mark.parametrize("signs", [[1, 1, -1], [1, -1, 1], [-1, -1, -1]])
def test_axis_signs_whose_yaw_is_not_the_product_are_refused_for_position_control(
    signs: list[int],
) -> None:
    """With position control, the sign of the yaw axis must be the product of the signs of x and y.

    Other signs are rejected. With velocity control, they are accepted.
    """
    assert check_all({"axis_signs": signs})
    with pytest.raises(ParameterError, match="'axis_signs'"):
        check_all({"axis_signs": signs, "control_method": "position"})
    assert check_all({"axis_signs": [1, -1, -1], "control_method": "position"})


def test_values_reach_the_core_under_their_meaning() -> None:
    """The value of each parameter reaches the setting with the same meaning.

    All values differ from the defaults, so the test finds misplaced values.
    """
    values = check_all(
        {
            "linear_scale": 71, "angular_scale": 501, "wheel_radius": 0.03, "delta_frame": "body",
            "delta_period": 0.1, "position_scale": 900, "heading_scale": 800,
            "pose_byte_order": "little", "accel_range": 8, "gyro_range": 1000,
            "max_linear_speed": 0.6, "max_angular_speed": 0.7, "max_wheel_speed": 18,
            "max_linear_acceleration": 0.8, "max_angular_acceleration": 0.9,
            "cmd_vel_timeout": 0.4, "command_rate": 25, "odom_wheel_drift": 0.03,
            "odom_wheel_scale": 0.06, "odom_wheel_slip": 0.05,
            "odom_gap_acceleration": 3, "odom_gap_angular_acceleration": 4,
            "use_board_pose": False, "base_radius": 0.2, "counts_per_revolution": 1000,
            "fastest_linear_speed": 1.5, "fastest_angular_speed": 5,
            "fastest_linear_acceleration": 16, "fastest_angular_acceleration": 51,
            "largest_force_step": 4.5, "odom_linear_scale": 1.1, "odom_angular_scale": 1.2,
            "baudrate": 57600,
            "gyro_bias": [0.1, 0.2, 0.3], "accel_bias": [1, 2, 3], "auto_gyro_bias": True,
        }
    )  # fmt: skip
    board = omnibot.settings(values)
    session = session_settings(values, omnibot.kinematics(values))
    assert board.baudrate == 57600
    assert (board.linear_scale, board.angular_scale, board.wheel_radius_m) == (71.0, 501.0, 0.03)
    assert (board.position_scale, board.heading_scale) == (900.0, 800.0)
    assert (board.delta_frame, board.pose_byte_order) == ("body", "little")
    assert board.delta_period_s == 0.1
    assert (board.imu.accel_range_g, board.imu.gyro_range_dps) == (8, 1000)
    limits = session.limits
    assert (limits.linear_mps, limits.angular_radps, limits.wheel_radps) == (0.6, 0.7, 18.0)
    assert (limits.linear_mps2, limits.angular_radps2) == (0.8, 0.9)
    assert (session.commands.timeout_s, session.commands.rate_hz) == (0.4, 25.0)
    assert (board.base_radius_m, board.counts_per_revolution) == (0.2, 1000)
    odometry, noise = session.odometry, session.odometry.noise
    assert (odometry.fastest_mps, odometry.fastest_radps) == (1.5, 5.0)
    assert odometry.use_board_pose is False
    assert (odometry.linear_scale, odometry.angular_scale) == (1.1, 1.2)
    assert session.motion == MotionLimits(
        fastest_mps=1.5,
        fastest_radps=5.0,
        fastest_mps2=16.0,
        fastest_radps2=51.0,
        force_step_mps2=4.5,
        full_scale_mps2=pytest.approx(8 * 9.80665),
    )
    assert (noise.wheel_scale, noise.wheels) == (0.06, OmniKinematics(1.0, 0.2))
    assert (noise.unheard_mps2, noise.unheard_radps2) == (3.0, 4.0)
    assert (noise.wheel_drift, noise.wheel_slip) == (0.03, 0.05)
    assert (session.imu.gyro_bias, session.imu.accel_bias) == ((0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    assert session.imu.auto_gyro_bias is True


def in_the_file() -> dict[str, object]:
    content = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    assert list(content) == ["/**"]
    assert list(content["/**"]) == ["ros__parameters"]
    values = content["/**"]["ros__parameters"]
    assert isinstance(values, dict)
    return values


def test_the_file_has_its_former_name_as_well() -> None:
    """For one release, the parameter file also exists under its former name, with equal content."""
    assert FORMER.read_bytes() == CONFIG.read_bytes()


def test_the_file_of_parameters_is_the_table() -> None:
    """The parameter file has every name with its default, of exactly the parameter's type.

    The names of unset parameters are in comments.
    """
    values = in_the_file()
    assert values == {row.name: row.default for row in PARAMETERS.rows if not row.unset}
    for name, value in values.items():
        assert type(value) is type(PARAMETERS.by_name[name].default), name


@pytest.mark.parametrize("parameter", PARAMETERS.rows, ids=name_of)
def test_the_file_tells_what_each_parameter_may_be(parameter: Parameter) -> None:
    """In the parameter file, the comment above a parameter has description, range and unit.

    Some parameters have choices in place of a range.
    """
    text = CONFIG.read_text(encoding="utf-8")
    comment = re.split(rf"\n    (?:# )?{parameter.name}:", text)[0].rsplit("\n\n", 1)[-1]
    words = " ".join(comment.replace("#", " ").split())
    assert parameter.description in words
    assert parameter.allowed in words


@pytest.mark.parametrize(
    ("kind", "unit", "fastest"), [("linear", "m/s", 2.0), ("angular", "rad/s", 8.0)]
)
def test_no_speed_is_commanded_that_odometry_takes_as_impossible(
    kind: str, unit: str, fastest: float
) -> None:
    """The driver rejects a speed limit that is above the fastest possible speed.

    Above the fastest possible speed, the odometry would reject every displacement without a
    message.
    """
    commanded, possible = f"max_{kind}_speed", f"fastest_{kind}_speed"
    assert check_all({commanded: fastest})[commanded] == fastest
    with pytest.raises(ParameterError) as refused:
        check_all({commanded: fastest + 0.5})
    sentence = str(refused.value)
    assert f"'{commanded}' ({fastest + 0.5:g} {unit})" in sentence
    assert f"'{possible}' ({fastest:g} {unit})" in sentence
    with pytest.raises(ParameterError, match=f"'{commanded}' .* above '{possible}'"):
        check_all({possible: 0.3})
    assert check_all({commanded: fastest + 0.5, possible: 9.0})


def test_a_range_that_begins_beyond_its_end_is_refused() -> None:
    """If a user sets a distance sensor's minimum above its maximum, the parameters are rejected.

    Otherwise, consumers would discard every measurement of the sensor.
    """
    table = boards.table_for({"board": "fejemis"})
    with pytest.raises(ParameterError, match=r"'tof_minimum' \(3 m\) must be below 'tof_maximum'"):
        table.check_all({"board": "fejemis", "tof_minimum": 3.0, "tof_maximum": 2.0})


def test_a_minimum_without_a_maximum_is_accepted() -> None:
    """A parameter ``battery_minimum`` is accepted if the board has no ``battery_maximum``."""
    row = Parameter("battery_minimum", 20.0, "V", "Lowest voltage.", low=0.0, high=60.0)
    assert parameters.table("omnibot", OmniBot.traits, own={"Own": (row,)}).check_all({})
