# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The dialogue with the user beside the robot: questions, progress, and the table of results."""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final, TypeVar

from rich.console import Console as RichConsole
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from omnibot_driver.tools.calibrate.result import Finding
from omnibot_driver.tools.needs import ToolError
from omnibot_driver.tools.printing import printing

T = TypeVar("T")

PLAIN_WIDTH: Final = 100
"""Width of output into a pipe or a file, in columns."""


class Console:
    """The dialogue with the user on a terminal.

    * ``yes``: answer every yes-or-no question with yes.
    * ``read``: asks a question and returns the answer.
    """

    def __init__(
        self, *, yes: bool = False, read: Callable[[str], str] = input, file: object = None
    ) -> None:
        out = file or sys.stdout
        terminal = bool(getattr(out, "isatty", lambda: False)())
        self.rich = RichConsole(
            file=out,  # type: ignore[arg-type]
            highlight=False,
            width=None if terminal else PLAIN_WIDTH,
        )
        self._yes, self._read = yes, read

    def say(self, text: str = "") -> None:
        """Print a paragraph."""
        self._print(text)

    def line(self, text: str) -> None:
        """Print one line without wrapping, so that the user can copy it."""
        self._print(text, soft_wrap=True)

    def confirm(self, question: str) -> None:
        """Ask for a confirmation. Raises ToolError if the answer is not yes."""
        if not self.asks(question):
            raise ToolError("you said no, so nothing was moved or written")

    def asks(self, question: str) -> bool:
        """Ask for yes or no; an empty answer means no."""
        if self._yes:
            self.say(f"{question} yes (--yes)")
            return True
        return self._answer(f"{question} [y/N] ").lower() in ("y", "yes")

    def number(self, question: str, unit: str, low: float, high: float) -> float:
        """Ask until the answer is a number from ``low`` to ``high``; return the number."""
        while True:
            answer = self._answer(f"{question} in {unit}: ")
            try:
                value = float(answer.replace(",", "."))
            except ValueError:
                value = math.nan
            if low <= value <= high:
                return value
            self.say(f"Please type a number from {low:g} to {high:g}, in {unit}.")

    def ask(self, question: str, understand: Callable[[str], T | None], otherwise: str) -> T:
        """Ask until ``understand`` accepts the answer; return what ``understand`` returned.

        If ``understand`` returns None, the tool prints ``otherwise`` and repeats the question.
        """
        while (meant := understand(self._answer(f"{question} "))) is None:
            self.say(otherwise)
        return meant

    def wait(self, request: str) -> None:
        """Print a request, and wait until the user confirms it with Enter."""
        self._answer(f"{request} [Enter] ")

    @contextmanager
    def progress(self, what: str) -> Iterator[Callable[[float], None]]:
        """Show the progress of the task ``what`` until the end of the ``with`` block.

        Yields a function that the caller calls with the completed fraction of the task, 0 to 1.
        """
        if not self.rich.is_terminal:
            self.say(f"{what} ...")
            yield lambda _part: None
            return
        columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
        with Progress(*columns, console=self.rich, transient=True) as bar:
            task = bar.add_task(what, total=1.0)
            yield lambda part: bar.update(task, completed=min(1.0, max(0.0, part)))
        self.say(f"{what}: done")

    def table(self, title: str, findings: Sequence[Finding]) -> None:
        """Print the results: each value with its uncertainty, and the driver's current value."""
        table = Table(title=title, title_justify="left", pad_edge=False)
        for heading in ("", "found", "±", "unit", "now"):
            table.add_column(heading, justify="left" if heading in ("", "unit") else "right")
        for one in findings:
            value, sigma, before = digits(one)
            table.add_row(one.name, value, sigma, one.unit, before)
        self._print(table)

    def _print(self, content: str | Table, *, soft_wrap: bool = False) -> None:
        with printing():
            self.rich.print(content, markup=False, soft_wrap=soft_wrap)

    def _answer(self, question: str) -> str:
        try:
            return self._read(question).strip()
        except EOFError:
            self.say()
            raise ToolError(
                f"no answer to “{question.strip()}”; use a terminal, or pipe the answers in"
            ) from None


def digits(finding: Finding) -> tuple[str, str, str]:
    """Return value, uncertainty and previous value of a finding, as texts.

    A known uncertainty is rounded to two significant digits, or, from 10 up, to a whole number. The
    values have as many decimals as the uncertainty.
    """
    value, sigma, before = finding.value, finding.sigma, finding.before
    places = None
    if sigma and math.isfinite(sigma):
        places = max(0, 1 - math.floor(math.log10(sigma)))
    return (
        _number(value, places),
        "" if sigma is None else _number(sigma, places),
        "" if before is None else _number(before, places),
    )


def _number(value: float | str, places: int | None) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.6g}" if places is None else f"{value:.{places}f}"
