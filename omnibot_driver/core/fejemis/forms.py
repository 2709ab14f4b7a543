# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Learns the form of each kind of line: its count of fields, and the decimals of each field.

A line in another form is rejected. If three such lines in a row have the same form, the third is
accepted, and its form is learnt.
"""

from typing import Final

IN_A_ROW: Final = 3
VARIES: Final = 8
VARIES_WITHOUT_SUM: Final = 18
"""Limit for the lines without a checksum, among 24 of one kind, that differ from the learnt form.

At the limit, the driver accepts every form of this kind of line. ``VARIES`` is the limit for lines
with a correct checksum.
"""
OF: Final = 24

Form = tuple[int, ...]


class Forms:
    """The learnt forms of lines: one form for each keyword.

    The keyword names the kind of the line.
    """

    def __init__(self) -> None:
        self._kinds: dict[bytes, _Kind] = {}

    def admit(self, text: bytes, *, summed: bool) -> bool:
        """Return whether the form of a line is accepted, and learn from this form.

        ``summed``: whether the line has a correct checksum.
        """
        keyword, *fields = text.split()
        form = tuple(map(_shape, fields))
        kind = self._kinds.get(keyword)
        if kind is None:
            kind = self._kinds[keyword] = _Kind(form)
        return kind.admit(form, VARIES if summed else VARIES_WITHOUT_SUM)


class _Kind:
    def __init__(self, form: Form) -> None:
        self._form = self._other = form
        self._others = self._seen = self._strange = 0
        self._varies = False

    def admit(self, form: Form, varies: int) -> bool:
        if self._varies:
            return True
        if self._seen == OF:
            self._seen = self._strange = 0
        self._seen += 1
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
    """Return how many decimals the field has; -1 for a whole number, -2 if it is not a number."""
    whole, point, after = field.partition(b".")
    if not point:
        return -1 if whole.lstrip(b"+-").isdigit() else -2
    return len(after) if after.isdigit() or not after else -2
