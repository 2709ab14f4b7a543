# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Write files completely or not at all, so that a crash or a full disk leaves no partial file.

This module knows paths; it does not know what is in the files.
"""

import contextlib
import os
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Final, TextIO

CHECK_FOLDER: Final = "check that the folder in `record_directory` can be written"
"""What the user can do if a record or a download is not saved."""


def write_whole(
    path: Path, write: Callable[[TextIO], object], *, wanted: Callable[[], bool] = lambda: True
) -> bool:
    """Write a text file in UTF-8 and create its folder; return whether ``path`` was written.

    * ``write``: writes the content to the open file, which does not convert line ends.
    * ``wanted``: called after ``write``; if it returns False, ``path`` stays as it was.

    Raises OSError; ``path`` then stays as it was.
    """
    import tempfile  # takes 1 MB, and few drivers ever write a file

    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}", dir=path.parent)
    try:
        with open(descriptor, "w", encoding="utf-8", newline="") as file:
            os.fchmod(descriptor, 0o644)
            write(file)
            file.flush()
            os.fsync(descriptor)
        if wanted():
            os.replace(name, path)
            return True
        os.unlink(name)
        return False
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise


def unused(path: Path) -> Path:
    """Return ``path`` if it is free; otherwise the first of NAME-2, NAME-3 ... that is free."""
    numbered = (path.with_stem(f"{path.stem}-{number}") for number in count(2))
    return path if not path.exists() else next(one for one in numbered if not one.exists())
