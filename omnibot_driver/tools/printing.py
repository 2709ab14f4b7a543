# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Prints a tool's result to standard output, which may be ASCII only, full or closed."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from omnibot_driver.tools.needs import ToolError


def replace_unprintable() -> None:
    """Print ? from now on for each character that the encoding of standard output lacks."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


@contextmanager
def printing() -> Iterator[None]:
    """A context for a block that only prints: a failure to print becomes an exception.

    Raises BrokenPipeError if the pipe's reader has ended, and ToolError if standard output cannot
    be written for another reason.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        discard_output()
        raise ToolError(f"the output cannot be written: {error}") from error


def discard_output() -> None:
    """Discard all further output.

    Otherwise, Python would try to write the remaining output at its end, and fail.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
