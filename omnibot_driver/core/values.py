# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Values that are made by the hundred each second: immutable to the type checker alone.

A frozen dataclass sets each field through ``object.__setattr__``, which triples the price of making
one. All code that is given such a value is type-checked, so nothing is lost by saving that.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import dataclass as value
else:
    from dataclasses import dataclass

    def value(*, frozen: bool, slots: bool) -> object:
        """A ``dataclass`` whose ``frozen`` holds for the type checker only."""
        return dataclass(slots=slots, unsafe_hash=frozen)


__all__ = ["value"]
