# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One parameter: its name, default, unit, range and meaning, and the check of its values."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from omnibot_driver.core.errors import ParameterError

TYPES: Final = {bool: "a bool", int: "an integer", float: "a double", str: "a string"}
"""Names of Python's types in ROS, for error messages."""
QUOTE: Final = "YAML reads on, off, yes and no as true or false; put the word in quotes"
RANGE_TYPES: Final = ("ultrasound", "infrared")
"""Allowed values of a parameter that gives the type of a range sensor."""
DUMPED_UNSET: Final = "null"
"""Value of an unset parameter in the file of ``ros2 param dump``, as the driver reads it."""
NUMBERS: Final = ("no", "one", "two", "three", "four", "five", "six")
Item = int | float | str
Value = bool | Item | list[int] | list[float] | list[str] | None


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter: a row in the parameter table of a board.

    * ``name``: lower case, with ``_`` between words. ``…_frame``: the value must be a frame name.
      ``…_minimum``, ``…_maximum``: limits of a range sensor in m, the first below the second.
    * ``unit``: such as "m/s"; empty if the value has no unit.
    * ``description``: its first sentence says what the value is or does.
    * ``default``: defines the type. A list has at least one item.
    * ``low``, ``high``, ``choices``: limits and allowed values of the value or of each item. A
      number needs both limits, or choices.
    * ``fixed``: whether the value is read-only after the start.
    * ``calibrated``: whether a calibration file may contain the value.
    * ``length``: smallest and largest length of a list; None: that of the default.
    * ``unset``: whether the value is None until the user sets it.
    """

    name: str
    default: Value
    unit: str
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[Item, ...] = ()
    fixed: bool = False
    calibrated: bool = False
    length: tuple[int, int] | None = None
    unset: bool = False

    @property
    def initial(self) -> Value:
        """Value if the user gives none: the default, or None for an ``unset`` parameter."""
        return None if self.unset else self.default

    @property
    def is_list(self) -> bool:
        """Whether the value is a list."""
        return isinstance(self.default, list)

    @property
    def kind(self) -> type:
        """Type of the value, or of each item of a list."""
        return type(self.default[0] if isinstance(self.default, list) else self.default)

    @property
    def lengths(self) -> tuple[int, int]:
        """Smallest and largest number of items of a list."""
        assert isinstance(self.default, list)
        return self.length or (len(self.default),) * 2

    @property
    def allowed(self) -> str:
        """Allowed values in words; empty when any value of the type is allowed."""
        if self.choices:
            choices = list(map(str, self.choices))
            return (
                f"each {' or '.join(choices)}" if self.is_list else f"one of {', '.join(choices)}"
            )
        if self.low is not None:
            each = "each " if self.is_list else ""
            return f"{each}{self.low:.10g} to {self.high:.10g} {self.unit}".rstrip()
        return ""

    def check(self, value: object) -> Value:
        """Return the value in the parameter's own type, such as 1.0 for the integer 1.

        Raises ParameterError if the parameter cannot have this value.
        """
        if self.unset and value in (None, DUMPED_UNSET):
            return None
        if isinstance(self.default, list):
            items: Value = self._check_list(value)
            return items
        value = _converted(value, self.kind)
        if type(value) is not self.kind:
            raise self._refusal(value, TYPES[self.kind])
        assert isinstance(value, bool | int | float | str)
        if not self._may_be(value):
            raise self._refusal(value, self.allowed)
        if self.name.endswith("_frame") and (not value or str(value).startswith("/")):
            raise self._refusal(value, "a frame name without a leading slash")
        if self.name == "port" and not value:
            raise self._refusal(value, "a device or a URL")
        if self.name == "frame_prefix" and str(value).startswith("/"):
            raise self._refusal(value, "a prefix without a leading slash, such as robot1/")
        return value

    def _check_list(self, value: object) -> Any:
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            raise self._refusal(value, f"an array of {TYPES[self.kind].split()[1]}s")
        given = list(value)
        items = [_converted(item, self.kind) for item in given]
        fewest, most = self.lengths
        if not fewest <= len(items) <= most or not all(
            type(item) is self.kind and self._may_be(item) for item in items
        ):
            raise self._refusal(given, self._shape)
        return items

    @property
    def _shape(self) -> str:
        things = "strings" if self.kind is str else "numbers"
        fewest, most = self.lengths
        count = NUMBERS[most] if most < len(NUMBERS) else str(most)
        count = count if fewest == most else f"{fewest} to {most}"
        things = things if most != 1 else things[:-1]
        return f"{count} {things}" + (f", {self.allowed}" if self.allowed else "")

    def _may_be(self, value: Any) -> bool:
        if self.choices:
            return value in self.choices
        if self.low is None or self.high is None:
            return True
        return bool(self.low <= value <= self.high)

    def _refusal(self, value: object, wanted: str) -> ParameterError:
        remark = f" ({QUOTE})" if self.kind is str and isinstance(value, bool) else ""
        given = "an empty value" if value is None else repr(value)  # rclpy: `[]` and `~` are None
        return ParameterError(f"parameter '{self.name}' must be {wanted}, not {given}{remark}")


def _converted(value: object, kind: type) -> object:
    """Convert an integer to a float, or a float such as 2.0 to an integer, if ``kind`` requires it.

    Other values are returned unchanged.
    """
    if kind is float and type(value) is int:
        return float(value)
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value
