# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the parameters of a Fejemis: what is written to the boards, and what is refused."""

import math
from pathlib import Path
from typing import Any

import pytest

from omnibot_driver import boards
from omnibot_driver.boards.fejemis import kinematics, settings
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.fejemis import Written


def check(**given: Any) -> dict[str, Any]:
    return boards.check_all({"board": "fejemis", **given})


def test_nothing_is_written_by_default() -> None:
    """By default the driver writes nothing to the boards, to keep their stored settings."""
    values = check()
    assert settings(values).written == {}
    assert kinematics(values).track_m == 0.4
    assert (values["port"], values["front_port"]) == ("/dev/ttyACM0", "/dev/ttyACM1")


def test_what_is_given_is_written_in_the_units_of_the_boards() -> None:
    """The driver writes the user's parameters to the boards in the boards' units."""
    values = check(
        wheel_radii=[0.08, 0.081],
        gear=20.0,
        encoder_ticks=64,
        track=0.41,
        steering_distance=0.45,
        front_wheel_offset=math.pi / 6,
        front_wheel_inverted=True,
        ir_calibration=[1.0, 2.0, 3.0, 4.0],
    )
    written = settings(values).written
    assert written[Written.WHEELS] == (0.08, 0.081, 20.0, 64.0, 0.41)
    assert written[Written.STEERING] == (0.41, 0.45)
    assert written[Written.FRONT_WHEEL] == (pytest.approx(30.0), 1.0)
    assert written[Written.INFRARED] == (1.0, 2.0, 3.0, 4.0)


@pytest.mark.parametrize(
    ("given", "missing"),
    [
        ({"gear": 20.0}, "wheel_radii"),
        ({"steering_distance": 0.4}, "track"),
        ({"front_wheel_offset": 0.1}, "front_wheel_inverted"),
        ({"front_wheel_inverted": True}, "front_wheel_offset"),
    ],
)
def test_what_one_command_takes_is_set_together(given: dict[str, Any], missing: str) -> None:
    """The user gives only some of the parameters that one command writes. This is refused.

    The driver cannot guess the missing values.
    """
    with pytest.raises(ParameterError, match=f"parameter '{missing}' must be set too"):
        check(**given)


def test_a_track_alone_is_refused() -> None:
    """The driver refuses ``track`` alone: two commands contain it, and both need further values."""
    with pytest.raises(ParameterError, match="also set 'steering_distance'"):
        check(track=0.4)


def test_the_same_port_twice_is_refused(tmp_path: Path) -> None:
    """The user gives the same port for both boards, perhaps under two names. This is refused."""
    link = tmp_path / "front"
    link.symlink_to("/dev/ttyACM0")
    for front in ("/dev/ttyACM0", str(link)):
        with pytest.raises(ParameterError, match="each have their own port"):
            check(port="/dev/ttyACM0", front_port=front)


def test_ports_are_not_compared_for_a_simulated_pair() -> None:
    """A simulated pair of boards does not use ``front_port``, so any value is accepted."""
    assert check(port="sim://")["front_port"] == "/dev/ttyACM1"


@pytest.mark.parametrize("name", ["baudrate", "max_wheel_speed", "axis_signs", "low_pass"])
def test_what_the_robot_has_no_use_for_is_refused(name: str) -> None:
    """The user gives a Fejemis a parameter that only other boards have. It is refused."""
    with pytest.raises(ParameterError, match=f"parameter '{name}' belongs to board"):
        check(**{name: 1})
