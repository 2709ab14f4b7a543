# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command line of the report: ``python -m omnibot_driver.tools.report BAG``."""

import argparse
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from omnibot_driver.files import unused
from omnibot_driver.tools.needs import ToolError, need
from omnibot_driver.tools.printing import discard_output, printing, replace_unprintable

if TYPE_CHECKING:
    from omnibot_driver.tools.report.bag import Progress
    from omnibot_driver.tools.report.log import Log

NEEDED: Final = ("numpy", "scipy", "matplotlib", "rich")
WRONG: Final = 3


def arguments(given: list[str] | None) -> argparse.Namespace:
    """Parse the command line. Exits with code 2 and a message on wrong usage."""
    parser = argparse.ArgumentParser(
        prog="report",
        description="Report on a drive: a page with pictures, and a verdict in words.",
        epilog="Exit codes: 0 with a report, 3 with a report that finds something wrong, 1 with a"
        " message if there is nothing to report on, 2 on wrong usage. See docs/tools/report.md.",
    )
    parser.add_argument("bag", nargs="?", type=Path, help="folder or file of a rosbag2")
    parser.add_argument(
        "--live",
        type=float,
        metavar="SECONDS",
        help="instead of a bag, listen to a running driver for this time, or until ctrl-C",
    )
    parser.add_argument(
        "--namespace", metavar="NAME", help="namespace of the robot, if there are several robots"
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FOLDER",
        help="folder for page and pictures (default: BAG_report, or an unused name such as"
        " live_report, in the current folder)",
    )
    parsed = parser.parse_args(given)
    if (parsed.bag is None) == (parsed.live is None):
        parser.error("give either a bag or --live SECONDS")
    if parsed.live is not None and not 1.0 <= parsed.live <= 86_400.0:
        parser.error("--live takes 1 to 86400 seconds")
    return parsed


@contextmanager
def _progress(what: str, unit: str) -> Iterator["Progress"]:
    """Show a progress bar if stderr is a terminal. Yield the function that updates the bar."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:,.0f} of {task.total:,.0f} " + unit),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _listen(seconds: float, namespace: str | None) -> "Log":
    try:
        from omnibot_driver.tools.report import live
    except ImportError as error:
        raise ToolError(f"--live needs ROS 2 Jazzy's Python packages: {error}") from error
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: signals.append(received))
    with _progress("listening", "s") as progress:
        log: Log = live.listen(seconds, namespace, progress, lambda: bool(signals))
    return log


def _read(path: Path, namespace: str | None) -> "Log":
    need("rosbags")
    from omnibot_driver.tools.report import bag

    with _progress("reading", "messages") as progress:
        return bag.read(path, namespace, progress)


def _report(wanted: argparse.Namespace) -> int:
    for module in NEEDED:
        need(module)
    from omnibot_driver.tools.report import page
    from omnibot_driver.tools.report.findings import Level
    from omnibot_driver.tools.report.judge import judge

    if wanted.live is not None:
        log, source = _listen(wanted.live, wanted.namespace), "live"
        default = unused(Path("live_report"))
    else:
        log, source = _read(wanted.bag, wanted.namespace), wanted.bag.resolve().name
        default = Path(f"{wanted.bag.resolve().stem}_report")
    findings = judge(log)
    folder = wanted.output or default
    try:
        written = page.write(log, findings, source, folder)
    except OSError as error:
        raise ToolError(f"{folder} cannot be written: {error}") from error
    try:
        with printing():
            print(f"{page.text(findings)}\n\n{written}", flush=True)
    except BrokenPipeError:  # the pipe's reader has ended; the files are written
        discard_output()
    except ToolError as error:
        raise ToolError(f"{error}; the report is in {written}") from error
    return WRONG if any(finding.level is Level.BAD for finding in findings) else 0


def main(given: list[str] | None = None) -> int:
    """Write the report. Return 0, or 3 if it finds something wrong.

    Return 1 if there is nothing to report on. Exit with code 2 on wrong usage.
    """
    replace_unprintable()
    try:
        return _report(arguments(given))
    except ToolError as error:
        print(f"report: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 1


if __name__ == "__main__":
    sys.exit(main())
