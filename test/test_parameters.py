# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The table of parameters against the interface, and what its checks say."""

import math
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.parameters import (
    BY_NAME,
    PARAMETERS,
    Parameter,
    board_settings,
    check_all,
    session_settings,
)

CONFIG = Path(__file__).parent.parent / "config" / "driver.yaml"

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

VECTORS = [BY_NAME["gyro_bias"], BY_NAME["accel_bias"]]
RANGED = [
    parameter for parameter in PARAMETERS if parameter.low is not None and parameter not in VECTORS
]
FLOATS = [parameter for parameter in PARAMETERS if isinstance(parameter.default, float)]
CHOICES = [parameter for parameter in PARAMETERS if parameter.choices]
FRAMES = [parameter for parameter in PARAMETERS if parameter.name.endswith("_frame")]


def name_of(parameter: object) -> str | None:
    return parameter.name if isinstance(parameter, Parameter) else None


@pytest.mark.parametrize(("name", "default"), PROMISED.items())
def test_every_promised_parameter_is_there_with_its_default(name: str, default: object) -> None:
    """Value and type: a float stays a float."""
    assert BY_NAME[name].default == default
    assert type(BY_NAME[name].default) is type(default)


@pytest.mark.parametrize("parameter", PARAMETERS, ids=name_of)
def test_every_default_passes_its_own_check_and_is_explained(parameter: Parameter) -> None:
    """With a description that is a sentence, and a unit where it is a measure."""
    value = parameter.check(parameter.default)
    assert value == parameter.default
    assert type(value) is type(parameter.default)
    assert parameter.description.endswith(".")
    assert (parameter.low is None) == (parameter.high is None)
    if isinstance(parameter.default, float):
        assert parameter.unit
        assert parameter.low is not None, "a number without limits lets NaN through"


def test_names_are_unique() -> None:
    """Two rows of one name would hide each other."""
    assert len(BY_NAME) == len(PARAMETERS)


@pytest.mark.parametrize("name", ["port", "odom_frame", "base_frame", "imu_frame"])
def test_identity_cannot_change_while_it_runs(name: str) -> None:
    """Port and frames are read-only."""
    assert BY_NAME[name].fixed


@pytest.mark.parametrize("name", ["max_linear_speed", "linear_scale", "cmd_vel_timeout"])
def test_tuning_may_change_while_it_runs(name: str) -> None:
    """It is found by trying."""
    assert not BY_NAME[name].fixed


@pytest.mark.parametrize("parameter", FLOATS, ids=name_of)
def test_an_integer_will_do_for_a_float(parameter: Parameter) -> None:
    """YAML's 1 is meant as 1.0."""
    assert parameter.high is not None
    value = parameter.check(int(parameter.high))
    assert type(value) is float
    assert value == parameter.high


@pytest.mark.parametrize("parameter", RANGED, ids=name_of)
def test_both_ends_of_a_range_are_allowed_and_nothing_beyond(parameter: Parameter) -> None:
    """The message names the parameter, what it may be, its unit, and what was given."""
    assert parameter.low is not None
    assert parameter.high is not None
    kind = type(parameter.default)
    assert parameter.check(kind(parameter.low)) == parameter.low
    assert parameter.check(kind(parameter.high)) == parameter.high
    for wrong in (parameter.low - 1, parameter.high + 1, -math.inf, math.inf, math.nan, 1e300):
        with pytest.raises(ParameterError) as caught:
            parameter.check(wrong)
        message = str(caught.value)
        assert f"'{parameter.name}'" in message
        assert repr(type(parameter.default)(wrong) if kind is float else wrong) in message or (
            str(int(wrong)) in message
        )
        if kind is float:
            assert f"{parameter.low:g} to {parameter.high:.10g} {parameter.unit}" in message


@pytest.mark.parametrize("parameter", CHOICES, ids=name_of)
def test_each_choice_is_allowed_and_the_message_lists_them(parameter: Parameter) -> None:
    """Nobody has to look them up."""
    for choice in parameter.choices:
        assert parameter.check(choice) == choice
    with pytest.raises(ParameterError) as caught:
        parameter.check("nonsense" if isinstance(parameter.default, str) else 3)
    for choice in parameter.choices:
        assert str(choice) in str(caught.value)


WRONG_TYPES: dict[type, list[object]] = {
    bool: [1, 0, 1.0, "true", None, [True]],
    int: [True, 1.5, "2", None, [2], math.nan, math.inf],
    float: [True, "0.5", None, [0.5], b"1"],
    str: [1, 1.0, True, None, ["a"], b"a"],
    list: [
        1, "111", None, True, b"111", [], [1, 1], [1, 1, 1, 1], [1, 9, 1], [1, 1, math.nan],
        ["1", "1", "1"], [None, 1, 1], [[1], [1], [1]],
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("parameter", "wrong"),
    [
        (parameter, wrong)
        for parameter in PARAMETERS
        for wrong in WRONG_TYPES[type(parameter.default)]
    ],
    ids=lambda value: value.name if isinstance(value, Parameter) else repr(value),
)
def test_a_value_of_another_type_is_refused(parameter: Parameter, wrong: object) -> None:
    """Always by a ParameterError that names the parameter."""
    with pytest.raises(ParameterError, match=f"'{parameter.name}'"):
        parameter.check(wrong)


json_like = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(),
        st.binary(),
    ),
    lambda inner: st.lists(inner, max_size=4),
)  # fmt: skip


@given(st.sampled_from(PARAMETERS), json_like)
def test_any_value_is_either_taken_in_the_right_type_or_refused(
    parameter: Parameter, value: object
) -> None:
    """Nothing else is raised, and what was taken is taken again."""
    try:
        taken = parameter.check(value)
    except ParameterError:
        return
    assert type(taken) is type(parameter.default)
    assert parameter.check(taken) == taken


@pytest.mark.parametrize("wrong", [[1, 0, 1], [1, 2, 1], [1, 1, 0.5]])
def test_axis_signs_are_nothing_but_ones(wrong: list[float]) -> None:
    """A sign is no factor."""
    with pytest.raises(ParameterError, match="each 1 or -1"):
        BY_NAME["axis_signs"].check(wrong)


@pytest.mark.parametrize("signs", [[1, -1, 1], (1, -1, 1), [1.0, -1.0, 1.0]])
def test_axis_signs_are_three_ones_of_either_sign(signs: object) -> None:
    """In any sequence; integers come of it."""
    taken = BY_NAME["axis_signs"].check(signs)
    assert taken == [1, -1, 1]
    assert isinstance(taken, list)
    assert all(type(sign) is int for sign in taken)


@pytest.mark.parametrize("parameter", FRAMES, ids=name_of)
@pytest.mark.parametrize("wrong", ["", "/odom"])
def test_a_frame_name_is_not_empty_and_has_no_leading_slash(
    parameter: Parameter, wrong: str
) -> None:
    """tf2 takes neither."""
    with pytest.raises(ParameterError, match=f"'{parameter.name}'"):
        parameter.check(wrong)


@pytest.mark.parametrize("wrong", ["/", "/robot1/"])
def test_a_frame_prefix_has_no_leading_slash(wrong: str) -> None:
    """tf2 knows no such frames; no prefix at all is one."""
    with pytest.raises(ParameterError, match=r"'frame_prefix'.*such as robot1/"):
        BY_NAME["frame_prefix"].check(wrong)
    assert BY_NAME["frame_prefix"].check("robot1/") == "robot1/"
    assert BY_NAME["frame_prefix"].check("") == ""


@pytest.mark.parametrize("parameter", VECTORS, ids=name_of)
def test_a_bias_is_three_numbers_each_within_its_range(parameter: Parameter) -> None:
    """Integers will do; floats come of it."""
    assert parameter.high is not None
    taken = parameter.check((1, -1, 0.5))
    assert taken == [1.0, -1.0, 0.5]
    assert isinstance(taken, list)
    assert all(type(number) is float for number in taken)
    for wrong in (parameter.high + 1, -math.inf, math.nan, True, "1"):
        with pytest.raises(ParameterError, match=f"'{parameter.name}'.*three numbers, each"):
            parameter.check([0.0, wrong, 0.0])


# The whole table


def test_what_is_not_given_is_the_default() -> None:
    """And what is given is taken."""
    assert check_all({}) == {parameter.name: parameter.default for parameter in PARAMETERS}
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
    """rclpy alone would ignore it in silence."""
    with pytest.raises(ParameterError, match=f"'{mistyped}'.*'{meant}'"):
        check_all({mistyped: 1})


@given(st.text())
def test_any_unknown_name_is_refused(name: str) -> None:
    """However far from all others, the empty one too."""
    if name not in BY_NAME:
        with pytest.raises(ParameterError, match="the nearest is"):
            check_all({name: 1})


def test_one_wrong_value_among_many_is_found() -> None:
    """By its name."""
    with pytest.raises(ParameterError, match="'command_rate'"):
        check_all({"port": "/dev/ttyACM3", "command_rate": 1e6, "baudrate": 9600})


@pytest.mark.parametrize("signs", [[1, 1, -1], [1, -1, 1], [-1, -1, -1]])
def test_axis_signs_that_no_mirror_makes_are_refused_for_position_control(
    signs: list[int],
) -> None:
    """Velocities can do with them, places cannot."""
    assert check_all({"axis_signs": signs})
    with pytest.raises(ParameterError, match="'axis_signs'"):
        check_all({"axis_signs": signs, "control_method": "position"})
    assert check_all({"axis_signs": [1, -1, -1], "control_method": "position"})


def test_values_reach_the_core_under_their_meaning() -> None:
    """Every one of them changed, none mistaken for another."""
    values = check_all(
        {
            "linear_scale": 71, "angular_scale": 501, "wheel_radius": 0.03, "delta_frame": "body",
            "position_scale": 900, "heading_scale": 800,
            "pose_byte_order": "little", "accel_range": 8, "gyro_range": 1000,
            "max_linear_speed": 0.6, "max_angular_speed": 0.7, "max_wheel_speed": 18,
            "max_linear_acceleration": 0.8, "max_angular_acceleration": 0.9,
            "cmd_vel_timeout": 0.4, "command_rate": 25, "odom_wheel_drift": 0.03,
            "odom_wheel_scale": 0.06, "odom_wheel_slip": 0.05,
            "odom_gap_acceleration": 3, "odom_gap_angular_acceleration": 4,
            "use_board_pose": False, "base_radius": 0.2, "counts_per_revolution": 1000,
            "fastest_linear_speed": 1.5, "fastest_angular_speed": 5,
            "gyro_bias": [0.1, 0.2, 0.3], "accel_bias": [1, 2, 3], "auto_gyro_bias": True,
        }
    )  # fmt: skip
    board, session = board_settings(values), session_settings(values)
    assert (board.linear_scale, board.angular_scale, board.wheel_radius_m) == (71.0, 501.0, 0.03)
    assert (board.position_scale, board.heading_scale) == (900.0, 800.0)
    assert (board.delta_frame, board.pose_byte_order) == ("body", "little")
    assert (board.imu.accel_range_g, board.imu.gyro_range_dps) == (8, 1000)
    limits = session.limits
    assert (limits.linear_mps, limits.angular_radps, limits.wheel_radps) == (0.6, 0.7, 18.0)
    assert (limits.linear_mps2, limits.angular_radps2) == (0.8, 0.9)
    assert (session.commands.timeout_s, session.commands.rate_hz) == (0.4, 25.0)
    assert (board.base_radius_m, board.counts_per_revolution) == (0.2, 1000)
    odometry, noise = session.odometry, session.odometry.noise
    assert (odometry.fastest_mps, odometry.fastest_radps) == (1.5, 5.0)
    assert odometry.use_board_pose is False
    assert (noise.wheel_scale, noise.base_radius_m) == (0.06, 0.2)
    assert (noise.unheard_mps2, noise.unheard_radps2) == (3.0, 4.0)
    assert (noise.wheel_drift, noise.wheel_slip) == (0.03, 0.05)
    assert (session.imu.gyro_bias, session.imu.accel_bias) == ((0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    assert session.imu.auto_gyro_bias is True


# The file


def in_the_file() -> dict[str, object]:
    content = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    assert list(content) == ["/**"]
    assert list(content["/**"]) == ["ros__parameters"]
    values = content["/**"]["ros__parameters"]
    assert isinstance(values, dict)
    return values


def test_the_file_of_parameters_is_the_table() -> None:
    """Every name with its default, in a type that a strict reader takes."""
    values = in_the_file()
    assert values == {parameter.name: parameter.default for parameter in PARAMETERS}
    for name, value in values.items():
        assert type(value) is type(BY_NAME[name].default), name


@pytest.mark.parametrize("parameter", PARAMETERS, ids=name_of)
def test_the_file_tells_what_each_parameter_may_be(parameter: Parameter) -> None:
    """Description, range or choices, and unit, in the comment above it."""
    text = CONFIG.read_text(encoding="utf-8")
    comment = text.split(f"\n    {parameter.name}:")[0].rsplit("\n\n", 1)[-1]
    words = " ".join(comment.replace("#", " ").split())
    assert parameter.description in words
    assert parameter.allowed in words
