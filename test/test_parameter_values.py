# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of single parameters: their valid values, and the message for an invalid value."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.parameters import Parameter

LIMITED = [parameter for parameter in PARAMETERS.rows if parameter.low is not None]
VECTORS = [parameter for parameter in LIMITED if parameter.is_list]
RANGED = [parameter for parameter in LIMITED if not parameter.is_list]
WHOLE = [
    parameter
    for parameter in RANGED
    if parameter.kind is float and math.floor(parameter.high) >= parameter.low
]
"""Float parameters whose range contains at least one integer."""
CHOICES = [row for row in PARAMETERS.rows if row.choices and not row.is_list]
FRAMES = [parameter for parameter in PARAMETERS.rows if parameter.name.endswith("_frame")]


def name_of(parameter: object) -> str | None:
    return parameter.name if isinstance(parameter, Parameter) else None


@pytest.mark.parametrize("parameter", WHOLE, ids=name_of)
def test_an_integer_will_do_for_a_float(parameter: Parameter) -> None:
    """A float parameter accepts an integer: YAML's 1 becomes 1.0."""
    assert parameter.high is not None
    whole = math.floor(parameter.high)
    value = parameter.check(whole)
    assert type(value) is float
    assert value == whole


@pytest.mark.parametrize("parameter", RANGED, ids=name_of)
def test_both_ends_of_a_range_are_allowed_and_nothing_beyond(parameter: Parameter) -> None:
    """Both ends of a range are valid, and values beyond them are rejected.

    The message names the parameter, the range, its unit and the value.
    """
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
            assert parameter.allowed in message


@pytest.mark.parametrize("parameter", CHOICES, ids=name_of)
def test_each_choice_is_allowed_and_the_message_lists_them(parameter: Parameter) -> None:
    """The message for a wrong value lists the choices."""
    for choice in parameter.choices:
        assert parameter.check(choice) == choice
    with pytest.raises(ParameterError) as caught:
        parameter.check("nonsense" if parameter.kind is str else max(parameter.choices) + 1)
    for choice in parameter.choices:
        assert str(choice) in str(caught.value)


WRONG_TYPES: dict[type, list[object]] = {
    bool: [1, 0, 1.0, "true", None, [True]],
    int: [True, 1.5, "2", None, [2], math.nan, math.inf],
    float: [True, "0.5", None, [0.5], b"1"],
    str: [1, 1.0, True, None, ["a"], b"a"],
}


def wrong_values(parameter: Parameter) -> list[object]:
    """Return values that do not have the parameter's type, or its number of items."""
    wrong = WRONG_TYPES[parameter.kind]
    if isinstance(parameter.default, list):
        fewest, most = parameter.lengths
        item = parameter.default[0]
        counts = [[item] * (most + 1), *([[item] * (fewest - 1)] if fewest else [])]
        items = [[one] + [item] * (most - 1) for one in wrong]
        wrong = [item, True, "111", b"111", None, *counts, *items]
    return [value for value in wrong if value is not None or not parameter.unset]


@pytest.mark.parametrize(
    ("parameter", "wrong"),
    [(parameter, wrong) for parameter in PARAMETERS.rows for wrong in wrong_values(parameter)],
    ids=lambda value: value.name if isinstance(value, Parameter) else repr(value),
)
def test_a_value_of_another_type_is_refused(parameter: Parameter, wrong: object) -> None:
    """A value of a wrong type always leads to a ParameterError that names the parameter."""
    with pytest.raises(ParameterError, match=f"'{parameter.name}'"):
        parameter.check(wrong)


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("port", 5, "must be a string, not 5"),
        (
            "on_exit",
            True,
            "must be a string, not True (YAML reads on, off, yes and no as true or false;",
        ),
        ("baudrate", "fast", "must be an integer, not 'fast'"),
        ("guard", 1, "must be a bool, not 1"),
        ("command_rate", True, "must be a double, not True"),
        ("gyro_bias", 0.1, "must be an array of doubles, not 0.1"),
        ("gyro_bias", None, "must be an array of doubles, not an empty value"),
        ("axis_signs", "111", "must be an array of integers, not '111'"),
        ("port", "", "must be a device or a URL, not ''"),
    ],
)
def test_types_are_told_in_the_words_of_ros(name: str, wrong: object, words: str) -> None:
    """Messages name types as ``ros2 param describe`` does, and explain how YAML reads ``no``."""
    with pytest.raises(ParameterError) as caught:
        PARAMETERS.by_name[name].check(wrong)
    message = str(caught.value)
    assert message.startswith(f"parameter '{name}' {words}")
    assert message.endswith(")") == (name == "on_exit")


json_like = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(),
        st.binary(),
    ),
    lambda inner: st.lists(inner, max_size=4),
)  # fmt: skip


@given(st.sampled_from(PARAMETERS.rows), json_like)
def test_any_value_is_either_taken_in_the_right_type_or_refused(
    parameter: Parameter, value: object
) -> None:
    """For any value, a check returns a value of the right type, or raises ParameterError.

    The check also accepts each value that it has returned.
    """
    try:
        taken = parameter.check(value)
    except ParameterError:
        return
    assert type(taken) is type(parameter.default) or (parameter.unset and taken is None)
    assert parameter.check(taken) == taken


@pytest.mark.parametrize("wrong", [[1, 0, 1], [1, 2, 1], [1, 1, 0.5]])
def test_axis_signs_are_nothing_but_ones(wrong: list[float]) -> None:
    """Values of ``axis_signs`` other than 1 and -1 are rejected."""
    with pytest.raises(ParameterError, match="each 1 or -1"):
        PARAMETERS.by_name["axis_signs"].check(wrong)


@pytest.mark.parametrize("signs", [[1, -1, 1], (1, -1, 1), [1.0, -1.0, 1.0]])
def test_axis_signs_are_three_ones_of_either_sign(signs: object) -> None:
    """``axis_signs`` accepts any sequence of three values 1 or -1.

    The result is a list of integers.
    """
    taken = PARAMETERS.by_name["axis_signs"].check(signs)
    assert taken == [1, -1, 1]
    assert isinstance(taken, list)
    assert all(type(sign) is int for sign in taken)


@pytest.mark.parametrize("parameter", FRAMES, ids=name_of)
@pytest.mark.parametrize("wrong", ["", "/odom"])
def test_a_frame_name_is_not_empty_and_has_no_leading_slash(
    parameter: Parameter, wrong: str
) -> None:
    """A frame name that is empty or has a leading slash is invalid in tf2, so it is rejected."""
    with pytest.raises(ParameterError, match=f"'{parameter.name}'"):
        parameter.check(wrong)


@pytest.mark.parametrize("wrong", ["/", "/robot1/"])
def test_a_frame_prefix_has_no_leading_slash(wrong: str) -> None:
    """A frame prefix with a leading slash is rejected, because tf2 does not allow it.

    An empty prefix is valid.
    """
    with pytest.raises(ParameterError, match=r"'frame_prefix'.*such as robot1/"):
        PARAMETERS.by_name["frame_prefix"].check(wrong)
    assert PARAMETERS.by_name["frame_prefix"].check("robot1/") == "robot1/"
    assert PARAMETERS.by_name["frame_prefix"].check("") == ""


@pytest.mark.parametrize("parameter", VECTORS, ids=name_of)
def test_each_item_of_a_list_is_within_the_range(parameter: Parameter) -> None:
    """Each item of a list may have any value of the range, and no other value."""
    assert parameter.low is not None
    assert parameter.high is not None
    kind, most = parameter.kind, parameter.lengths[1]
    for limit in (parameter.low, parameter.high):
        assert parameter.check([kind(limit)] * most) == [limit] * most
    for wrong in (parameter.low - 1, parameter.high + 1, -math.inf, math.nan, True, "1"):
        with pytest.raises(
            ParameterError, match=rf"'{parameter.name}'.* numbers?, each"
        ) as refused:
            parameter.check([kind(parameter.low)] * (most - 1) + [wrong])
        assert parameter.allowed in str(refused.value)


@pytest.mark.parametrize("name", ["gyro_bias", "accel_bias"])
def test_a_bias_is_three_numbers(name: str) -> None:
    """A bias is three numbers. Integers are accepted and become floats."""
    taken = PARAMETERS.by_name[name].check((1, -1, 0.5))
    assert taken == [1.0, -1.0, 0.5]
    assert isinstance(taken, list)
    assert all(type(number) is float for number in taken)
    with pytest.raises(ParameterError, match=f"'{name}'.*three numbers, each"):
        PARAMETERS.by_name[name].check([0.0, 0.0])


GAINS = Parameter("gains", [1.0], "m", "Two to four gains.", low=0.0, high=10.0, length=(2, 4))
WORDS = Parameter("words", ["on"], "", "Any words.", choices=("on", "off"), length=(0, 2))
ANY = Parameter("any", ["x"], "", "One word.")


@pytest.mark.parametrize(
    ("parameter", "value", "taken"),
    [
        (GAINS, [1, 2.5], [1.0, 2.5]),
        (GAINS, (1.0, 2.0, 3.0, 4.0), [1.0, 2.0, 3.0, 4.0]),
        (WORDS, [], []),
        (WORDS, ["on", "off"], ["on", "off"]),
        (ANY, ["anything"], ["anything"]),
    ],
)
def test_a_list_may_have_any_length_that_its_row_allows(
    parameter: Parameter, value: object, taken: object
) -> None:
    """A list parameter accepts any number of items from its minimum to its maximum length."""
    assert parameter.check(value) == taken


@pytest.mark.parametrize(
    ("parameter", "wrong", "sentence"),
    [
        (GAINS, [1.0], "must be 2 to 4 numbers, each 0 to 10 m, not [1.0]"),
        (GAINS, [1.0, 11.0], "must be 2 to 4 numbers, each 0 to 10 m, not [1.0, 11.0]"),
        (GAINS, 1.0, "must be an array of doubles, not 1.0"),
        (WORDS, ["no"], "must be 0 to 2 strings, each on or off, not ['no']"),
        (WORDS, [True], "must be 0 to 2 strings, each on or off, not [True]"),
        (ANY, ["a", "b"], "must be one string, not ['a', 'b']"),
        (ANY, "a", "must be an array of strings, not 'a'"),
    ],
)
def test_a_wrong_list_is_refused_with_what_it_may_be(
    parameter: Parameter, wrong: object, sentence: str
) -> None:
    """A list has a wrong number, type or range of items. The message says what is allowed."""
    with pytest.raises(ParameterError) as refused:
        parameter.check(wrong)
    assert str(refused.value).startswith(f"parameter '{parameter.name}' {sentence}")


def test_what_the_board_keeps_is_unset_until_it_is_given() -> None:
    """Some parameters are stored by the board. Their value is None until the user sets them.

    Their default value only determines their type.
    """
    gain = Parameter("gain", 1.0, "1", "A gain.", low=0.0, high=9.0, unset=True)
    assert gain.initial is None
    assert gain.check(None) is None
    assert gain.check(2) == 2.0
    assert gain.check("null") is None  # from a file that ros2 param dump has written
    with pytest.raises(ParameterError, match="'gain' must be 0 to 9"):
        gain.check(10.0)
    with pytest.raises(ParameterError, match="must be a double, not an empty value"):
        replace(gain, unset=False).check(None)
