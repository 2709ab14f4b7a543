# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writes the parts of the documents that come from the code.

``make docs`` runs this script. A test compares the files with the script's output.
"""

import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from omnibot_driver import boards
from omnibot_driver.core.board import Mode
from omnibot_driver.core.omnibot.modes import TRANSITIONS
from omnibot_driver.parameters import Parameter, Value

ROOT: Final = Path(__file__).resolve().parent.parent
PARAMETERS_INTRODUCTION: Final = """\
# Parameters

Give parameters one by one (`--ros-args -p max_linear_speed:=0.3`) or in a file.
`config/<board>.yaml` has all parameters of a board: for the OmniBot it is
[omnibot.yaml](../config/omnibot.yaml). The driver reads `board` (default `omnibot`) first.

- You can set a *dynamic* parameter while the driver runs
  (`ros2 param set /omnibot_driver max_linear_speed 0.3`). It takes effect at once.
- You can set a *fixed* parameter only at the start.

The driver rejects an unknown name, a wrong type and a value out of its range. The message says
which values are valid. The driver also rejects a parameter of another board, and names that board.

In an array of doubles, write every element with a decimal point: `[0.1, 0.0, 0.0]`. ROS itself
rejects a mixed array such as `[0.1, 0, 0]`. Put the value of a string parameter in quotes if it is
a word such as `on` or `no`. Without quotes, ROS reads such a word as true or false.

A parameter file begins with `/**:`, which stands for every node. If the file begins with the name
of another node or namespace, ROS ignores the file, and the driver warns you.
"""
TYPES: Final = {bool: "bool", int: "int", float: "double", str: "string"}


def parameter_file(board: str) -> str:
    """Return config/<board>.yaml: each parameter with its default, and its range as a comment."""
    lines = [
        f"# All parameters of the board {board}, with their defaults. Load this file, or a changed",
        "# copy of it, with",
        f"#   ros2 run omnibot_driver driver --ros-args --params-file {board}.yaml",
        "# A parameter that is marked as fixed can be set only when the driver starts.",
        "/**:",
        "  ros__parameters:",
    ]
    for title, rows in boards.load(board).PARAMETERS.sections.items():
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
            lines.append(
                f"    # {row.name}:" if row.unset else f"    {row.name}: {_yaml(row.default)}"
            )
    return "\n".join(lines) + "\n"


def parameters_page() -> str:
    """Return docs/parameters.md: tables of all parameters, one board after the other."""
    lines = PARAMETERS_INTRODUCTION.splitlines()
    for board in boards.PROFILES:
        lines += ["", f"## The board `{board}`"]
        for title, rows in boards.load(board).PARAMETERS.sections.items():
            lines += [
                "",
                f"### {title}",
                "",
                "| Name | Type | Default | Unit | Allowed | Set | Meaning |",
                "|---|---|---|---|---|---|---|",
                *map(_row, rows),
            ]
    return "\n".join(lines) + "\n"


def _row(row: Parameter) -> str:
    fewest, most = row.lengths if row.is_list else (0, 0)
    size = f"{most}" if fewest == most else f"{fewest} to {most}"
    allowed = row.allowed.removesuffix(row.unit).strip() if row.low is not None else row.allowed
    cells = [
        f"`{row.name}`",
        TYPES[row.kind] + (f"[{size}]" if row.is_list else ""),
        "unset" if row.unset else f"`{_yaml(row.default)}`",
        row.unit,
        allowed,
        "fixed" if row.fixed else "dynamic",
        row.description,
    ]
    return "| " + " | ".join(cells) + " |"


def _yaml(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and "." not in str(value):
        return str(value).replace("e", ".0e")  # YAML 1.1 reads 1e-06 as a string
    return str(value) if value != "" else '""'


def architecture() -> str:
    """Return docs/internals/architecture.md, with the table of modes from the code."""
    lines = ["| | " + " | ".join(mode.value for mode in Mode) + " |", "|---|---|---|---|---|"]
    for happening, after in TRANSITIONS.items():
        cells = [after[mode].value if mode in after else "refused" for mode in Mode]
        lines.append(f"| {happening.value} | " + " | ".join(cells) + " |")
    text = (ROOT / "docs/internals/architecture.md").read_text(encoding="utf-8")
    before, begin, rest = text.partition("<!-- modes: begin -->\n")
    _, end, after_table = rest.partition("<!-- modes: end -->")
    return before + begin + "\n".join(lines) + "\n" + end + after_table


GENERATED: Final[dict[str, Callable[[], str]]] = {
    **{f"config/{board}.yaml": partial(parameter_file, board) for board in boards.PROFILES},
    "config/driver.yaml": partial(parameter_file, "omnibot"),  # former name, kept for one release
    "docs/internals/architecture.md": architecture,
    "docs/parameters.md": parameters_page,
}


def main() -> None:
    """Write all generated files."""
    for name, text in GENERATED.items():
        (ROOT / name).write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
