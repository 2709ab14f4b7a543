# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether there is a screen. Knows the streams of this process; nothing of what is shown."""

import os
import sys


def has_screen() -> bool:
    """A terminal to draw on, and to read keys from."""
    drawable = os.environ.get("TERM", "dumb") != "dumb"
    return drawable and all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))
