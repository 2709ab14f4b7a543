# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Repairs copies of bag files whose recording was not finished.

An mcap file (mcap.dev/spec) has records (kind: 1 byte, length: 8 bytes, content) and an index. An
sqlite3 database can have its latest changes in a separate file, the journal.
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
"""The end of an mcap file that has an empty index."""
JOURNALS: Final = ("-wal", "-journal")


def breaks_off(file: Path) -> bool:
    """Return whether this mcap file lacks its end, because its recording was not finished."""
    with file.open("rb") as source:
        source.seek(max(0, file.stat().st_size - len(MAGIC)))
        return source.read() not in (MAGIC, b"")


def cut_to_records(file: Path, folder: Path) -> Path:
    """Return a copy of this mcap file that has all complete records and a valid end."""
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
    """Return whether this sqlite3 database has a journal with its latest changes."""
    return any(journal.exists() for journal in _journals(file))


def with_journal(file: Path, folder: Path) -> Path:
    """Return a copy of this sqlite3 database that includes the changes in its journal."""
    copy = Path(shutil.copy(file, folder))
    for journal in filter(Path.exists, _journals(file)):
        shutil.copy(journal, folder)
    with closing(sqlite3.connect(copy)) as database:
        database.execute("PRAGMA journal_mode=DELETE")
    return copy


def _journals(file: Path) -> list[Path]:
    return [file.with_name(file.name + ending) for ending in JOURNALS]
