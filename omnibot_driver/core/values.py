# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A dataclass decorator for values made hundreds of times a second: frozen for type checkers only.

At run time, a frozen dataclass takes three times as long to create.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import dataclass as value
else:
    from dataclasses import dataclass

    def value(*, frozen: bool, slots: bool) -> object:
        """Return a ``dataclass`` decorator. Only type checkers enforce ``frozen``."""
        return dataclass(slots=slots, unsafe_hash=frozen)


__all__ = ["value"]
