# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The performance report, which ``make bench`` writes into docs/internals/performance.md.

The report compares the driver with the *floor*: the smallest program with the same output.

``--quick``: short measurements, to test that the program runs. Exit code 1: a ratio of driver to
floor is above its limit.
"""

import argparse
import os
import platform
import sys
from importlib import import_module
from pathlib import Path

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # Python stores bytecode, as for users
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
sys.path.insert(0, str(Path(__file__).parents[1] / "integrity"))  # for the generator of streams

import core
import small
import system
import threads
from adapters import ADAPTERS
from ratios import Figure, table

DOCUMENT = Path(__file__).parents[2] / "docs" / "internals" / "performance.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
OTHERS = {"lois_ecu": "lois_ecu_bench", "mart": "mart_bench", "fejemis": "fejemis_bench"}
"""For each board except the OmniBot: the module that measures the driver with this board."""
SCALES = (1, 2, 4, 8)


def say(what: str) -> None:
    """Print which measurement begins now."""
    print(f"... {what}", file=sys.stderr, flush=True)


def measure(*, quick: bool) -> tuple[list[Figure], list[str]]:
    """Return comparisons of the driver with the floor, and further sections of the report.

    The floor is the smallest program with the same output as the driver.
    """
    windows = 2 if quick else 6
    figures: list[Figure] = []
    for adapter in ADAPTERS:
        say(f"{adapter}: latency, processor time, commands")
        measured, node_memory = system.measurements(adapter, windows)
        figures += [*measured, system.commands(adapter, windows)]
    say("start")
    figures += [system.starts(1 if quick else 3), system.imports(2 if quick else 5)]
    say("decoding")
    figures += core.decoding(1 if quick else 5)
    say("split")
    sections = ["", "Processor time of the driver by stage:", "", *system.split(5 if quick else 20)]
    sections += ["", "Processor time by thread:", "", *threads.table(5 if quick else 20)]
    say("step by step")
    sections += ["", "From the floor to the driver, by ratios:", "", *system.steps(windows)]
    sections += ["", core.cold(200 if quick else 2000)]
    say("many drivers")
    scale = system.scale(SCALES[:2] if quick else SCALES, 3 if quick else 10)
    sections += ["", "Several drivers on this machine, each with a board:", "", *scale]
    say("small computer")
    sections += ["", "On a part of one core (driver and floor each have a part of this size):", ""]
    sections += small.table(*(((1.0, 0.25), 3.0) if quick else ()))
    say("linearity")
    sections += ["", "Time to decode, by the length of the stream:", "", *core.linearity()]
    say("memory")
    sections += ["", "Memory of the processes:", "", *system.memory()]
    sections += ["", f"{core.memory(0.1 if quick else 1.0)} {node_memory}"]
    return figures, sections


def main() -> int:
    """Run the measurements, print them, and write them into the document. Return the exit code."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument(
        "--board", choices=("omnibot", *OTHERS), default="omnibot", help="board to measure"
    )
    arguments.add_argument("--quick", action="store_true")
    chosen = arguments.parse_args()
    begin, measured = BEGIN, measure
    if chosen.board in OTHERS:
        begin = BEGIN.replace("figures", f"figures of {chosen.board}")
        measured = import_module(OTHERS[chosen.board]).measure
    figures, sections = measured(quick=chosen.quick)
    machine = (
        f"{os.cpu_count()} processors, load {os.getloadavg()[2]:.1f} over the last 15 minutes,"
        f" Linux, Python {platform.python_version()}:"
    )
    text = "\n".join([machine, "", *(table(figures) if figures else []), *sections])
    print(text)
    if not chosen.quick:
        document = DOCUMENT.read_text()
        before, rest = document.split(begin)
        after = rest.split(END, 1)[1]
        DOCUMENT.write_text(f"{before}{begin}\n{text}\n{END}{after}")
    return 0 if all(each.goal is None or each.ratio <= each.goal for each in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
