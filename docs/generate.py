# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writes what the documents take from the code: `make docs` runs it, a test compares.

Each text is a function of the code alone, so whoever changes the code sees what to commit.
"""

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Final

import mode_diagram

from omnibot_driver.core.board import Mode
from omnibot_driver.core.omnibot.modes import TRANSITIONS
from omnibot_driver.parameters import SECTIONS, Parameter, Value

ROOT: Final = Path(__file__).resolve().parent.parent
PARAMETERS_INTRODUCTION: Final = """\
# Parameters

Give them one by one (`--ros-args -p max_linear_speed:=0.3`) or in a file:
[config/driver.yaml](../config/driver.yaml) has them all. *Dynamic* ones can be set while the driver
runs (`ros2 param set /omnibot_driver max_linear_speed 0.3`) and count at once; *fixed* ones are
given at the start. An unknown name, a wrong type or a value out of its range is refused with a
sentence that says what would be right.

In an array of doubles every element has a decimal point, `[0.1, 0.0, 0.0]`: ROS itself refuses a
mixed one, `[0.1, 0, 0]`. A word such as `on` or `no` that is meant as a string is put in quotes.
A parameter file begins with `/**:`; if its first line names another node or namespace, ROS passes
it over without a word.
"""
TYPES: Final = {bool: "bool", int: "int", float: "double", str: "string"}


def driver_yaml() -> str:
    """config/driver.yaml: every parameter with its default, and in a comment what it may be."""
    lines = [
        "# Every parameter of the driver, with its default. Give the file with",
        "#   ros2 run omnibot_driver driver --ros-args --params-file driver.yaml",
        "# or change a copy of it. (fixed) marks what cannot change while the driver runs.",
        "/**:",
        "  ros__parameters:",
    ]
    for title, rows in SECTIONS.items():
        lines += ["", f"    # --- {title} ---"]
        for row in rows:
            notes = "; ".join(filter(None, [row.allowed, "fixed" if row.fixed else ""]))
            comment = row.description + (f" ({notes})" if notes else "")
            lines.append("")
            lines += textwrap.wrap(
                comment,
                100,
                initial_indent="    # ",
                subsequent_indent="    # ",
                break_on_hyphens=False,
            )
            lines.append(f"    {row.name}: {_yaml(row.default)}")
    return "\n".join(lines) + "\n"


def parameters_page() -> str:
    """docs/parameters.md: the same for readers."""
    lines = PARAMETERS_INTRODUCTION.splitlines()
    for title, rows in SECTIONS.items():
        lines += [
            "",
            f"## {title}",
            "",
            "| Name | Type | Default | Unit | Allowed | Set | Meaning |",
            "|---|---|---|---|---|---|---|",
            *map(_row, rows),
        ]
    return "\n".join(lines) + "\n"


def _row(row: Parameter) -> str:
    kind = row.default[0] if isinstance(row.default, list) else row.default
    allowed = row.allowed.removesuffix(row.unit).strip() if row.low is not None else row.allowed
    cells = [
        f"`{row.name}`",
        TYPES[type(kind)] + ("[3]" if isinstance(row.default, list) else ""),
        f"`{_yaml(row.default)}`",
        row.unit,
        allowed,
        "fixed" if row.fixed else "dynamic",
        row.description,
    ]
    return "| " + " | ".join(cells) + " |"


def _yaml(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if value != "" else '""'


def architecture() -> str:
    """docs/architecture.md with its mode table as it is in the code."""
    lines = ["| | " + " | ".join(mode.value for mode in Mode) + " |", "|---|---|---|---|---|"]
    for happening, after in TRANSITIONS.items():
        cells = [after[mode].value if mode in after else "refused" for mode in Mode]
        lines.append(f"| {happening.value} | " + " | ".join(cells) + " |")
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    before, begin, rest = text.partition("<!-- modes: begin -->\n")
    _, end, after_table = rest.partition("<!-- modes: end -->")
    return before + begin + "\n".join(lines) + "\n" + end + after_table


GENERATED: Final[dict[str, Callable[[], str]]] = {
    "config/driver.yaml": driver_yaml,
    "docs/architecture.md": architecture,
    "docs/parameters.md": parameters_page,
    "docs/pictures/modes.svg": mode_diagram.svg,
}


def main() -> None:
    """Write them all."""
    for name, text in GENERATED.items():
        (ROOT / name).write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
