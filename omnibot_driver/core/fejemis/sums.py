# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The checksum ``;NN`` in front of a line. It does not detect:

* 1 in 99 random changes.
* The loss of a ``c``, whose code is 99.
* The loss of two characters whose codes add up to 99 or 198.
"""

import re
from typing import Final

MODULUS: Final = 99
_CONTROL: Final = bytes(range(0x20))
_SUMMED: Final = re.compile(rb";([0-9]{2})(.*)", re.DOTALL).fullmatch


def sum_of(text: bytes) -> int:
    """Return the checksum, 1..99, of a line's text without its ``;NN``."""
    return sum(text.translate(None, _CONTROL)) % MODULUS + 1


def with_sum(text: bytes) -> bytes:
    """Return the text with its checksum, ``;NN``, in front; the line end is not added."""
    return b";%02d%s" % (sum_of(text), text)


def without_sum(line: bytes) -> tuple[bytes, bool | None]:
    """Return a line's text, and whether its checksum is right; None if the line has no checksum."""
    if not line.startswith(b";"):
        return line, None
    found = _SUMMED(line)
    if found is None:
        return line, False
    return found[2], int(found[1]) == sum_of(found[2])
