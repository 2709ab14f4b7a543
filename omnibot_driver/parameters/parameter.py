# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One parameter: name, default, unit, range, meaning, and the check of a value. Knows no ROS."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from omnibot_driver.core.errors import ParameterError

TYPES: Final = {bool: "a bool", int: "an integer", float: "a double", str: "a string"}
"""In the words of ROS."""
QUOTE: Final = "YAML reads on, off, yes and no as bool: put it in quotes"
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
    choices: tuple[int | float | str, ...] = ()
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
            raise self._refusal(value, self._kind)
        if isinstance(value, list):
            return self._check_three(value)
        assert isinstance(value, bool | int | float | str)
        if self.choices and value not in self.choices:
            raise self._refusal(value, self.allowed)
        if not self._in_range(value):
            raise self._refusal(value, self.allowed)
        if self.name.endswith("_frame") and (not value or str(value).startswith("/")):
            raise self._refusal(value, "a frame name without a leading slash")
        if self.name == "port" and not value:
            raise self._refusal(value, "a device or a URL")
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

    @property
    def _kind(self) -> str:
        if isinstance(self.default, list):
            return f"an array of {TYPES[type(self.default[0])].split()[1]}s"
        return TYPES[type(self.default)]

    def _refusal(self, value: object, wanted: str) -> ParameterError:
        remark = f" ({QUOTE})" if isinstance(self.default, str) and isinstance(value, bool) else ""
        return ParameterError(f"parameter '{self.name}' must be {wanted}, not {value!r}{remark}")
