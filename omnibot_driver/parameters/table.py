# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""All parameters of one board: common ones that the board can use, and its own ones.

This module does not use ROS, and does not name any board.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.requests import Request
from omnibot_driver.core.traits import Traits
from omnibot_driver.parameters import operating, robot
from omnibot_driver.parameters.parameter import Parameter, Value

Check = Callable[[Mapping[str, Any]], None]
"""Function that checks the values of all parameters together. It raises ParameterError."""

COMMON: Final = {
    "The line": operating.LINE,
    "Commands": operating.COMMANDS,
    "Frames": operating.FRAMES,
    "The robot": robot.ROBOT,
    "The IMU": robot.IMU,
    "Measurement uncertainty": robot.NOISE,
}


def _has_imu(traits: Traits) -> bool:
    return bool(traits.imu)


def _takes_twists(traits: Traits) -> bool:
    return Authority.BASE in traits.authorities


def _checks_accelerations(traits: Traits) -> bool:
    return bool(traits.imu) or not traits.own_odometry


NEEDS: Final[Mapping[str, Callable[[Traits], bool]]] = {
    "baudrate": lambda traits: traits.baudrate,
    "auto_start": lambda traits: Request.START in traits.requests,
    "enable_stamped_cmd_vel": _takes_twists,
    "max_linear_speed": _takes_twists,
    "max_angular_speed": _takes_twists,
    "max_linear_acceleration": _takes_twists,
    "max_angular_acceleration": _takes_twists,
    "max_wheel_speed": lambda traits: Authority.WHEELS in traits.authorities,
    "fastest_linear_acceleration": _checks_accelerations,
    "fastest_angular_acceleration": _checks_accelerations,
    "imu_frame": _has_imu,
    "gyro_bias": _has_imu,
    "accel_bias": _has_imu,
    "auto_gyro_bias": _has_imu,
    "largest_force_step": _has_imu,
    "linear_acceleration_stddev": _has_imu,
    "angular_velocity_stddev": _has_imu,
}
"""For each common parameter that depends on the traits of the board: the function that decides
whether a board with these traits has the parameter."""
DISPENSABLE: Final = frozenset(
    {
        "baudrate",
        "axis_signs",
        "odom_linear_scale",
        "odom_angular_scale",
        "odom_wheel_drift",
        "odom_wheel_scale",
        "odom_wheel_slip",
        "odom_gap_acceleration",
        "odom_gap_angular_acceleration",
        "twist_linear_stddev",
        "twist_angular_stddev",
    }
)
"""Common parameters that a board may omit. The driver reads all others that fit the traits of the
board."""
LAST_WORDS: Final = {"pause": Request.PAUSE, "reset": Request.RESET}
"""Values of the parameter ``on_exit`` besides ``stop``, each with the driver's last request to the
board. A board offers a value if it supports the request."""


@dataclass(frozen=True, slots=True)
class Table:
    """All parameters of one board, by section.

    ``checks``: functions that check the values of several parameters together.
    ``by_name``: all parameters by name.
    """

    board: str
    sections: Mapping[str, Sequence[Parameter]]
    checks: Sequence[Check]
    by_name: Mapping[str, Parameter] = field(init=False)

    def __post_init__(self) -> None:
        rows = {row.name: row for section in self.sections.values() for row in section}
        object.__setattr__(self, "by_name", rows)

    @property
    def rows(self) -> tuple[Parameter, ...]:
        """All parameters, in the order of the sections."""
        return tuple(self.by_name.values())

    @property
    def calibrated(self) -> tuple[str, ...]:
        """Names of the parameters that a calibration file may contain."""
        return tuple(row.name for row in self.rows if row.calibrated)

    def check_all(self, given: Mapping[str, object]) -> dict[str, Value]:
        """Return all values by name: the given value, or the default.

        Raises ParameterError if a name is unknown or a value is wrong.
        """
        for name in given:
            if name not in self.by_name:
                raise ParameterError(
                    f"there is no parameter '{name}'; the nearest is"
                    f" '{nearest(name, self.by_name)}' (config/{self.board}.yaml lists all"
                    " parameters)"
                )
        values = {row.name: row.check(given.get(row.name, row.initial)) for row in self.rows}
        for check in self.checks:
            check(values)
        return values


def table(
    board: str,
    traits: Traits,
    *,
    own: Mapping[str, Sequence[Parameter]] | None = None,
    without: Collection[str] = (),
    changed: Mapping[str, Mapping[str, Any]] | None = None,
    checks: Sequence[Check] = (),
) -> Table:
    """Return the table of a board with these traits. Raises ValueError if a name is wrong.

    * ``own``: rows that only this board has, by section.
    * ``without``: names in ``DISPENSABLE`` that this board does not have.
    * ``changed``: changed fields of common rows, such as ``{"port": {"default": "udp://"}}``.
    * ``checks``: functions that check several values together.
    """
    changes = {
        "on_exit": {
            "choices": (
                "stop",
                *(word for word, request in LAST_WORDS.items() if request in traits.requests),
            )
        },
        **(changed or {}),
    }
    common = {row.name for rows in COMMON.values() for row in rows}
    if unknown := {*without, *changes} - common:
        raise ValueError(
            f"only parameters in COMMON can be changed or omitted, not {', '.join(sorted(unknown))}"
        )
    if kept := sorted({*without} - DISPENSABLE):
        raise ValueError(
            f"the board {board} must have the parameters {', '.join(kept)}, because the driver"
            " reads them. The only parameters that a board may omit are"
            f" {', '.join(sorted(DISPENSABLE))}"
        )
    sections = {
        title: tuple(
            replace(row, **changes.get(row.name, {}))
            for row in rows
            if NEEDS.get(row.name, _always)(traits) and row.name not in without
        )
        for title, rows in COMMON.items()
    }
    chosen = replace(operating.BOARD, default=board, choices=(board,))
    sections["The line"] = (chosen, *sections["The line"])
    for title, rows in (own or {}).items():
        sections[title] = (*sections.get(title, ()), *rows)
    return Table(
        board,
        {title: rows for title, rows in sections.items() if rows},
        (_require_two_frames, _require_possible_speeds, _require_ranges, *checks),
    )


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the name in ``names`` that is most similar to ``name``."""
    import difflib  # only needed for a wrong name, so rarely

    return difflib.get_close_matches(name, list(names), n=1, cutoff=0.0)[0]


def _always(_traits: Traits) -> bool:
    return True


def _require_two_frames(values: Mapping[str, Any]) -> None:
    if values["odom_frame"] == values["base_frame"]:
        raise ParameterError(
            "parameter 'odom_frame' must differ from 'base_frame', but both are"
            f" '{values['odom_frame']}'"
        )


def _require_ranges(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if a range sensor's smallest distance is not below its largest one.

    A parameter with ``_minimum`` but without its ``_maximum`` is not checked.
    """
    for least in (name for name in values if name.endswith("_minimum")):
        most = f"{least.removesuffix('minimum')}maximum"
        if most in values and values[least] >= values[most]:
            raise ParameterError(
                f"parameter '{least}' ({values[least]:g} m) must be below '{most}'"
                f" ({values[most]:g} m)"
            )


def _require_possible_speeds(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if a ``max_*_speed`` is above its ``fastest_*_speed``.

    Odometry rejects motion above ``fastest_*_speed`` as impossible.
    """
    for kind, unit in (("linear", "m/s"), ("angular", "rad/s")):
        commanded, possible = f"max_{kind}_speed", f"fastest_{kind}_speed"
        if commanded in values and values[commanded] > values[possible]:
            raise ParameterError(
                f"parameter '{commanded}' ({values[commanded]:g} {unit}) must not be above"
                f" '{possible}' ({values[possible]:g} {unit}): odometry rejects faster motion as"
                f" impossible. Lower '{commanded}', or raise '{possible}' first"
            )
