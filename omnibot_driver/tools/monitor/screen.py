# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detect a usable terminal. Knows the streams of this process, not what is shown."""

import os
import sys


def has_screen() -> bool:
    """Return whether this process has a terminal to draw on and to read keys from."""
    drawable = os.environ.get("TERM", "dumb") != "dumb"
    return drawable and all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))
