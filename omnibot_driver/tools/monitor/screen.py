# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detects whether this process has a usable terminal."""

import os
import sys


def has_screen() -> bool:
    """Return whether this process has a terminal on which to draw, and from which to read keys."""
    drawable = os.environ.get("TERM", "dumb") != "dumb"
    return drawable and all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))
