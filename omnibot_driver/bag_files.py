# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Opens a bag in rosbag2 format, a folder or one file, even if its recorder was killed.

This module does not know the content of a message.
"""

from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import McapReader

from omnibot_driver import salvage

STORAGES: Final = (".mcap", ".db3")


def open_bag(path: Path, stack: ExitStack) -> tuple[list[Reader], list[str]]:
    """Return readers of all files that can be opened, and a text about each defect of the bag.

    The readers are sorted by the times of their first messages.
    """
    files, troubles = [path], []
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix in STORAGES)
        if (path / "metadata.yaml").exists():
            try:
                return [stack.enter_context(Reader(path))], []
            except Exception as error:  # a damaged file may cause any error in the library
                troubles.append(f"the bag is damaged ({in_a_line(error)})")
        elif files:
            troubles.append("the bag was never finished (metadata.yaml is missing)")
        else:
            troubles.append("it has neither metadata.yaml nor a .mcap or .db3 file")
    readers: list[Reader] = []
    for file in files:
        try:
            readers.append(_open_file(file, stack, troubles))
        except Exception as error:
            troubles.append(f"{file.name} cannot be read: {in_a_line(error)}")
    return sorted(readers, key=lambda reader: reader.start_time), troubles


def messages(
    reader: Reader, topics: Collection[str], troubles: list[str]
) -> Iterator[tuple[Connection, int, bytes]]:
    """Yield the messages up to the first error in the bag; add this error to ``troubles``.

    Also add a text if the bag's index has more messages than were read.
    """
    wanted = [item for item in reader.connections if item.topic in topics]
    if not wanted:
        return
    storage, count = reader.storage, 0
    try:
        if isinstance(storage, McapReader) and not storage.chunks:
            # If the mcap file has no index, ``messages`` requires ascending times, which a bag does
            # not guarantee.
            found = storage.messages_scan(wanted)
        else:
            found = reader.messages(wanted)
        for message in found:
            count += 1
            yield message
    except Exception as error:  # a damaged file may cause any error in the library
        troubles.append(f"{reader.path} cannot be read to its end: {in_a_line(error)}")
        return
    # rosbags skips a damaged part of an mcap file, and does not report it.
    if count < (total := sum(item.msgcount for item in wanted)):
        troubles.append(f"{reader.path} is damaged: only {count} of {total} messages can be read")


def in_a_line(error: Exception) -> str:
    """Return the text of the error in one line, without a full stop."""
    return " ".join(str(error).split()).rstrip(".")


def _open_file(file: Path, stack: ExitStack, troubles: list[str]) -> Reader:
    """Open a file of a bag. If it is incomplete or has a journal, repair it in a copy first."""
    broken = file.suffix == ".mcap" and salvage.breaks_off(file)
    whole = file
    if broken or salvage.has_journal(file):
        make_whole = salvage.cut_to_records if broken else salvage.with_journal
        whole = make_whole(file, Path(stack.enter_context(TemporaryDirectory())))
    reader = stack.enter_context(Reader(whole))
    if broken:
        troubles.append(f"the file {file.name} is incomplete; only its undamaged part is read")
    return reader
