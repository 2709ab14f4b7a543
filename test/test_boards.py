# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the profiles. A profile connects one kind of board to the rest of the driver."""

import ast
import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from omnibot_driver import boards, messages
from omnibot_driver.core.board import Board
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.omnibot import OmniBot
from omnibot_driver.core.requests import Request
from omnibot_driver.parameters import Parameter, session_settings, table
from omnibot_driver.parameters.table import DISPENSABLE
from omnibot_driver.simulator.__main__ import boards as simulated_boards
from omnibot_driver.simulator.common import options

PACKAGE = Path(boards.__file__).parent.parent
KNOW_BOARDS = ("boards", *boards.PROFILES)
"""Folders whose modules may import the code of a particular board."""


def imported(path: Path) -> set[str]:
    """Return the names of the modules that a module imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


@pytest.mark.parametrize(
    "path",
    [
        path
        for path in sorted(PACKAGE.rglob("*.py"))
        if not set(path.relative_to(PACKAGE).parts) & set(KNOW_BOARDS)
    ],
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_common_code_imports_no_board(path: Path) -> None:
    """Common code, such as session, link and node, imports no module of a particular board."""
    known = {
        f"omnibot_driver.{place}.{name}" for place in ("core", "boards") for name in boards.PROFILES
    }
    assert not {name for name in imported(path) for one in known if name.startswith(one)}


@pytest.mark.parametrize("name", boards.PROFILES)
def test_every_profile_makes_its_board_of_the_defaults(name: str) -> None:
    """Every profile can make its board with the default values of the parameters.

    The board's kinematics has one joint for each of its wheels.
    """
    values = boards.check_all({"board": name})
    profile = boards.load(name)
    board = profile.make(values)
    assert board.settings == profile.settings(values)
    assert len(profile.kinematics(values).joints) == len(board.traits.wheels)


@pytest.mark.parametrize("name", boards.PROFILES)
def test_every_profile_names_its_simulated_board(name: str) -> None:
    """The command ``simulator --board NAME`` runs the simulated board of the profile NAME."""
    module = boards.load(name).SIMULATOR
    assert module == f"omnibot_driver.simulator.{name}"
    assert name in simulated_boards()
    board, _ = options.from_words([], options.load(module))
    assert board.facts.keys() >= {"x_m", "y_m", "yaw_rad"}


@pytest.mark.parametrize("wrong", ["martha", ""])
def test_an_unknown_board_is_refused_with_the_names_of_the_known_ones(wrong: str) -> None:
    """The parameter ``board`` is a name that no board has. The error names all known boards."""
    names = ", ".join(boards.PROFILES)
    with pytest.raises(ParameterError, match=f"'board' must be one of {names}, not '{wrong}'"):
        boards.check_all({"board": wrong})


@pytest.mark.parametrize("wrong", [5, True, None, ["omnibot"]])
def test_a_board_that_is_not_a_name_is_refused(wrong: object) -> None:
    """The parameter ``board`` is not a string. The error says that it must be one."""
    with pytest.raises(ParameterError, match="'board' must be a string"):
        boards.check_all({"board": wrong})


@pytest.mark.parametrize("name", boards.PROFILES)
def test_every_profile_has_a_table_of_its_own(name: str) -> None:
    """In the parameter table of a profile, all names are unique.

    The parameter ``board`` has only one valid value, the name of the profile.
    """
    table = boards.load(name).PARAMETERS
    assert sum(map(len, table.sections.values())) == len(table.rows)
    assert (table.board, table.by_name["board"].choices) == (name, (name,))
    assert boards.owners_of("port") == list(boards.PROFILES)


@pytest.mark.parametrize("name", boards.PROFILES)
def test_each_board_has_every_member_of_the_protocol(name: str) -> None:
    """The common code uses only members of the class ``Board``. Each board has all of them.

    A board need not inherit from this class.
    """
    board = boards.load(name).make(boards.check_all({"board": name}))
    members = {*vars(Board), *Board.__annotations__}
    missing = [each for each in members if not each.startswith("_") and not hasattr(board, each)]
    assert missing == []


@pytest.mark.parametrize("name", boards.PROFILES)
def test_a_board_has_a_baudrate_exactly_if_its_messages_name_it(name: str) -> None:
    """A board has the parameter ``baudrate`` if its ``traits.baudrate`` is true, and only then.

    If this trait is true, the driver's advice about a silent board names ``baudrate``.
    """
    profile = boards.load(name)
    board = profile.make(boards.check_all({"board": name}))
    assert ("baudrate" in profile.PARAMETERS.by_name) is board.traits.baudrate


@pytest.mark.parametrize("name", boards.PROFILES)
def test_the_advice_of_a_board_names_its_own_parameters(name: str) -> None:
    profile = boards.load(name)
    advice = profile.make(boards.check_all({"board": name})).traits.advice
    named = {word for text in advice.values() for word in re.findall(r"`(\w+)`", text)}
    assert named <= profile.PARAMETERS.by_name.keys()


FEW = replace(
    OmniBot.traits,
    imu_period_s=None,
    authorities=frozenset({Authority.POSE}),
    requests=frozenset({Request.RESET}),
)
OWN = Parameter("tow_distance", 1.0, "m", "How far.", low=0.0, high=5.0)


@pytest.mark.parametrize("name", boards.PROFILES)
def test_the_texts_about_an_imu_are_true_for_the_board(name: str) -> None:
    """The parameter descriptions say about an IMU only what is true for the board.

    * ``gyro_bias`` says that ``~/calibrate_gyro`` measures the bias, unless the board subtracts it.
    * Only the OmniBot's parameters quote the noise of an IMU.
    """
    profile = boards.load(name)
    traits = profile.make(boards.check_all({"board": name})).traits
    texts = {row.name: row.description for row in profile.PARAMETERS.rows}
    if traits.imu:
        measured_by_service = "~/calibrate_gyro measures it" in texts["gyro_bias"]
        assert measured_by_service is not traits.calibrates_gyro
    assert any("√Hz" in text for text in texts.values()) is (name == "omnibot")


def refuse_far_docks(values: Mapping[str, Any]) -> None:
    if values["tow_distance"] > 2.0:
        raise ParameterError("too far")


def test_a_table_has_what_the_board_can_use_and_its_own() -> None:
    """A board has its own parameters, and only those common parameters that it can use.

    The board's profile may change the defaults of common parameters.
    """
    own = table(
        "few",
        FEW,
        own={"Docking": (OWN,)},
        without=("baudrate",),
        changed={"port": {"default": "udp://10.0.0.1:5000"}},
        checks=(refuse_far_docks,),
    )
    assert own.sections["Docking"] == (OWN,)
    assert "The IMU" not in own.sections
    assert own.by_name["on_exit"].choices == ("stop", "reset")
    assert own.by_name["port"].default == "udp://10.0.0.1:5000"
    assert own.by_name["port"].fixed
    absent = {
        "auto_start", "baudrate", "gyro_bias", "imu_frame", "linear_acceleration_stddev",
        "max_linear_speed", "max_wheel_speed", "enable_stamped_cmd_vel", "accel_range",
    }  # fmt: skip
    assert not absent & set(own.by_name)
    assert {"cmd_vel_timeout", "odom_frame", "fastest_linear_speed"} <= set(own.by_name)
    values = own.check_all({"tow_distance": 2})
    assert values["tow_distance"] == 2.0
    with pytest.raises(ParameterError, match="too far"):
        own.check_all({"tow_distance": 3.0})


@pytest.mark.parametrize("name", ["guard", "port", "on_exit", "auto_gyro_bias", "max_linear_speed"])
def test_a_row_that_the_driver_reads_cannot_be_dropped(name: str) -> None:
    """A profile omits a parameter that the driver needs. This is an error.

    The error message lists the parameters that a profile may omit.
    """
    with pytest.raises(ValueError, match=f"must have the parameters {name}, .* omit .* axis_signs"):
        table("few", FEW, without=("baudrate", name))


def test_what_may_be_dropped_is_asked_for_by_a_default() -> None:
    """Some boards lack some of the common parameters.

    Common code reads these parameters with a default value, never by indexing.
    """
    indexed = {
        node.slice.value
        for path in PACKAGE.rglob("*.py")
        if path.relative_to(PACKAGE).parts[0] not in ("boards", "tools")
        and any(f'"{name}"' in (text := path.read_text()) for name in {"guard", *DISPENSABLE})
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant)
    }
    assert "guard" in indexed
    assert not indexed & DISPENSABLE


def test_the_core_takes_a_board_that_lacks_most_parameters() -> None:
    """The core's functions that read parameters work for a board that lacks most of them."""
    values = table("few", FEW).check_all({})
    settings = session_settings(values, OmniKinematics(0.029, 0.143))
    assert settings.limits.wheel_radps == 0.0
    assert (
        messages.MessageSettings.from_parameters(values, OmniKinematics(0.029, 0.143)).imu_frame
        == ""
    )


def test_a_parameter_of_another_board_is_refused_by_that_boards_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A parameter of another board is refused, and the error names that board.

    For an unknown parameter, the error names the most similar one.
    """
    other = SimpleNamespace(PARAMETERS=table("few", FEW, own={"Docking": (OWN,)}))
    monkeypatch.setitem(boards.PROFILES, "few", "few_profile")
    monkeypatch.setitem(sys.modules, "few_profile", other)
    assert boards.check_all({"board": "few", "tow_distance": 1})["board"] == "few"
    with pytest.raises(ParameterError) as refused:
        boards.check_all({"board": "few", "delta_frame": "earth"})
    assert (
        str(refused.value)
        == "parameter 'delta_frame' belongs to board omnibot, not to few; remove it, or set the"
        " parameter `board`"
    )
    with pytest.raises(ParameterError, match="'tow_distance' belongs to board few, not to omnib"):
        boards.check_all({"tow_distance": 1.0})
    with pytest.raises(ParameterError, match=r"'tow_distanc'.*'tow_distance'.*config/few\.yaml"):
        boards.check_all({"board": "few", "tow_distanc": 1.0})
