# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The parameters of one board: those common ones that it can use, and its own. Knows no ROS.

Knows no board by name: a board's profile makes its table, of what the board can do and of the rows
that it brings.
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
"""Of all values together; raises ParameterError."""

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


NEEDS: Final[Mapping[str, Callable[[Traits], bool]]] = {
    "baudrate": lambda traits: traits.baudrate,
    "auto_start": lambda traits: Request.START in traits.requests,
    "enable_stamped_cmd_vel": _takes_twists,
    "max_linear_speed": _takes_twists,
    "max_angular_speed": _takes_twists,
    "max_linear_acceleration": _takes_twists,
    "max_angular_acceleration": _takes_twists,
    "max_wheel_speed": lambda traits: Authority.WHEELS in traits.authorities,
    "imu_frame": _has_imu,
    "gyro_bias": _has_imu,
    "accel_bias": _has_imu,
    "auto_gyro_bias": _has_imu,
    "largest_force_step": _has_imu,
    "linear_acceleration_stddev": _has_imu,
    "angular_velocity_stddev": _has_imu,
}
"""What a board must be able to do for a common parameter to mean anything."""
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
"""Common parameters that may mean nothing to a board; the driver reads all others on each."""
LAST_WORDS: Final = {"pause": Request.PAUSE, "reset": Request.RESET}
"""What a board may be left in when the driver ends, besides stopped: what it takes."""


@dataclass(frozen=True, slots=True)
class Table:
    """Every parameter of one board by section, and what must hold between them."""

    board: str
    sections: Mapping[str, Sequence[Parameter]]
    checks: Sequence[Check]
    by_name: Mapping[str, Parameter] = field(init=False)

    def __post_init__(self) -> None:
        rows = {row.name: row for section in self.sections.values() for row in section}
        object.__setattr__(self, "by_name", rows)

    @property
    def rows(self) -> tuple[Parameter, ...]:
        """All rows in order."""
        return tuple(self.by_name.values())

    @property
    def calibrated(self) -> tuple[str, ...]:
        """Names of those that a calibration file may hold."""
        return tuple(row.name for row in self.rows if row.calibrated)

    def check_all(self, given: Mapping[str, object]) -> dict[str, Value]:
        """Every parameter's value, from those given and the defaults. Raises ParameterError."""
        for name in given:
            if name not in self.by_name:
                raise ParameterError(
                    f"there is no parameter '{name}'; the nearest is"
                    f" '{nearest(name, self.by_name)}' (config/{self.board}.yaml has them all)"
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
    """The table of a board that can do this.

    ``own``: rows of its own, by section; ``without``: those of ``DISPENSABLE`` that mean nothing to
    it; what its traits have no use for is left out anyway;
    ``changed``: by name, fields of common ones that differ (``{"port": {"default": "udp://"}}``);
    ``checks``: what must hold between its values, besides what must on every board.
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
        raise ValueError(f"these are not common parameters: {', '.join(sorted(unknown))}")
    if kept := sorted({*without} - DISPENSABLE):
        raise ValueError(
            f"the board {board} must not be without {', '.join(kept)}: the driver reads them on"
            f" every board that its traits fit; it may be without {', '.join(sorted(DISPENSABLE))}"
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
        (_require_two_frames, _require_possible_speeds, *checks),
    )


def nearest(name: str, names: Iterable[str]) -> str:
    """The one of these names that is most like it, however little."""
    import difflib  # for a name that is wrong, so hardly ever

    return difflib.get_close_matches(name, list(names), n=1, cutoff=0.0)[0]


def _always(_traits: Traits) -> bool:
    return True


def _require_two_frames(values: Mapping[str, Any]) -> None:
    if values["odom_frame"] == values["base_frame"]:
        raise ParameterError(
            f"parameter 'odom_frame' must not be '{values['odom_frame']}', which is 'base_frame':"
            " a frame cannot move within itself"
        )


def _require_possible_speeds(values: Mapping[str, Any]) -> None:
    """Reject speed limits above the fastest believable speed, at which odometry would stop."""
    for kind, unit in (("linear", "m/s"), ("angular", "rad/s")):
        commanded, possible = f"max_{kind}_speed", f"fastest_{kind}_speed"
        if commanded in values and values[commanded] > values[possible]:
            raise ParameterError(
                f"parameter '{commanded}' ({values[commanded]:g} {unit}) must not be above"
                f" '{possible}' ({values[possible]:g} {unit}): odometry rejects what is faster than"
                f" that as impossible. Lower '{commanded}', or raise '{possible}' first"
            )
