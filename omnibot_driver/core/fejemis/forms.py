# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The form of each kind of line: how many fields, and how many decimals each number has.

A board prints a kind of line always alike, so one of another form has lost or gained characters.
The form is learnt: what came three times in a row is the new one. A kind whose form keeps changing
is not looked at. Knows no meaning.
"""

from typing import Final

IN_A_ROW: Final = 3
VARIES: Final = 8
VARIES_WITHOUT_SUM: Final = 18
"""Lines of another form than expected, of ``OF``, after which the kind varies. Where a sum is right
damage is rare, so fewer of them tell."""
OF: Final = 24

Form = tuple[int, ...]


class Forms:
    """One for each line."""

    def __init__(self) -> None:
        self._kinds: dict[bytes, _Kind] = {}

    def admit(self, text: bytes, *, summed: bool) -> bool:
        """Whether the line looks like those of its kind before it; ``summed``: its sum is right."""
        keyword, *fields = text.split()
        form = tuple(map(_shape, fields))
        kind = self._kinds.get(keyword)
        if kind is None:
            kind = self._kinds[keyword] = _Kind(form)
        return kind.admit(form, VARIES if summed else VARIES_WITHOUT_SUM)


class _Kind:
    """Of one keyword."""

    def __init__(self, form: Form) -> None:
        self._form = self._other = form
        self._others = self._seen = self._strange = 0
        self._varies = False

    def admit(self, form: Form, varies: int) -> bool:
        if self._varies:
            return True
        self._seen += 1
        if self._seen > OF:
            self._seen = self._strange = 0
        if form == self._form:
            self._others = 0
            return True
        self._strange += 1
        self._others = self._others + 1 if form == self._other else 1
        self._other = form
        if self._strange >= varies:
            self._varies = True
        elif self._others >= IN_A_ROW:
            self._form, self._others, self._strange = form, 0, 0
        return self._varies or form == self._form


def _shape(field: bytes) -> int:
    """Count of decimals; -1 of a whole number, -2 of anything else."""
    whole, point, after = field.partition(b".")
    if not point:
        return -1 if whole.lstrip(b"+-").isdigit() else -2
    return len(after) if after.isdigit() or not after else -2
