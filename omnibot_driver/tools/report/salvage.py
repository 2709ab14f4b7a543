# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Files of bags that were never finished, made whole in a copy.

An mcap (mcap.dev/spec) is a row of records, each an operation of one byte, its length in eight, and
that many bytes; then comes an index, without which it can be read as well. What sqlite3 has written
last is in a file of its own beside the database.
"""

import shutil
import sqlite3
import struct
from contextlib import closing
from pathlib import Path
from typing import Final

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")
NO_RECORD, FOOTER, DATA_END = 0x00, 0x02, 0x0F
END: Final = HEAD.pack(DATA_END, 4) + bytes(4) + HEAD.pack(FOOTER, 20) + bytes(20) + MAGIC
"""An index that has nothing."""
JOURNALS: Final = ("-wal", "-journal")


def breaks_off(file: Path) -> bool:
    """Whether this mcap has a beginning and no end."""
    with file.open("rb") as source:
        source.seek(max(0, file.stat().st_size - len(MAGIC)))
        return source.read() not in (MAGIC, b"")


def cut_to_records(file: Path, folder: Path) -> Path:
    """A copy of this mcap with all whole records and an end."""
    copy = Path(shutil.copy(file, folder))
    size = copy.stat().st_size
    with copy.open("r+b") as target:
        whole = target.seek(len(MAGIC))
        while len(head := target.read(HEAD.size)) == HEAD.size:
            operation, length = HEAD.unpack(head)
            if operation in (NO_RECORD, DATA_END) or target.tell() + length > size:
                break
            whole = target.seek(length, 1)
        target.seek(whole)
        target.truncate()
        target.write(END)
    return copy


def has_journal(file: Path) -> bool:
    """Whether this sqlite3 database has changes that are still in its journal."""
    return any(journal.exists() for journal in _journals(file))


def with_journal(file: Path, folder: Path) -> Path:
    """A copy of this sqlite3 database that has all in it."""
    copy = Path(shutil.copy(file, folder))
    for journal in filter(Path.exists, _journals(file)):
        shutil.copy(journal, folder)
    with closing(sqlite3.connect(copy)) as database:
        database.execute("PRAGMA journal_mode=DELETE")
    return copy


def _journals(file: Path) -> list[Path]:
    return [file.with_name(file.name + ending) for ending in JOURNALS]
