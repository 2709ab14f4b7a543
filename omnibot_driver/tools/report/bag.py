# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reads a rosbag2 without ROS: its folder or one file, sqlite3 or mcap, also compressed."""

from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_typestore

from omnibot_driver.tools.needs import ToolError
from omnibot_driver.tools.report import salvage
from omnibot_driver.tools.report.findings import counted
from omnibot_driver.tools.report.log import Log
from omnibot_driver.tools.report.recorder import Recorder
from omnibot_driver.tools.report.robots import choose, find

STORAGES: Final = (".mcap", ".db3")
NEWS_EVERY: Final = 2000
"""How many messages are read between two reports of progress."""

Progress = Callable[[int, int], None]
"""A function that receives how many messages have been read, and how many there are."""


def read(path: Path, namespace: str | None, progress: Progress) -> Log:
    """Return the log of one robot in a bag.

    Raises ToolError if the bag has no readable message of the robot, or if it has several robots
    and ``namespace`` is None.
    """
    with ExitStack() as stack:
        readers, troubles = _open(path, stack)
        connections = [connection for reader in readers for connection in reader.connections]
        if not any(reader.message_count for reader in readers):
            if troubles:
                raise ToolError(f"{path} has no message that can be read: {'; '.join(troubles)}")
            raise ToolError(f"{path} is empty: nothing was recorded into it")
        robots = find((item.topic, item.msgtype) for item in connections)
        robot, topics = choose(robots, namespace, str(path))
        recorder = Recorder(robot)
        total = sum(item.msgcount for item in connections if item.topic in topics)
        types = get_typestore(Stores.ROS2_JAZZY)
        damaged = 0
        for reader in readers:
            messages = _messages(reader, topics.keys(), troubles)
            for count, (item, arrived_ns, data) in enumerate(messages, recorder.count + damaged):
                if count % NEWS_EVERY == 0:
                    progress(count, total)
                try:
                    message = types.deserialize_cdr(data, item.msgtype)
                    recorder.hear(topics[item.topic], item.msgtype, arrived_ns, message)
                except Exception:  # a damaged message may cause any error in the library
                    damaged += 1
        progress(total, total)
    if damaged:
        troubles.append(f"{counted(damaged, 'message')} damaged and skipped")
    if not recorder.count:
        why = "; ".join(troubles) or "the topics of this robot are empty"
        raise ToolError(f"{path} has no message of the robot {robot}: {why}")
    return recorder.log(tuple(troubles), alone=len(robots) == 1)


def _messages(
    reader: Reader, topics: Collection[str], troubles: list[str]
) -> Iterator[tuple[Connection, int, bytes]]:
    """Yield the messages up to the first error in the bag; add this error to ``troubles``."""
    wanted = [item for item in reader.connections if item.topic in topics]
    if not wanted:
        return
    storage = reader.storage
    try:
        if isinstance(storage, McapReader) and not storage.chunks:
            # If the mcap file has no index, ``messages`` requires ascending times, which a bag does
            # not guarantee.
            yield from storage.messages_scan(wanted)
        else:
            yield from reader.messages(wanted)
    except Exception as error:  # a damaged file may cause any error in the library
        troubles.append(f"{reader.path} cannot be read to its end: {_in_a_line(error)}")


def _open(path: Path, stack: ExitStack) -> tuple[list[Reader], list[str]]:
    """Return readers of all files that can be opened, and a text about each defect of the bag."""
    if not path.exists():
        raise ToolError(f"there is no {path}: give the folder of a bag, or its .mcap or .db3 file")
    files, troubles = [path], []
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix in STORAGES)
        if (path / "metadata.yaml").exists():
            try:
                return [stack.enter_context(Reader(path))], []
            except Exception as error:
                troubles.append(f"the bag is damaged ({_in_a_line(error)})")
        elif files:
            troubles.append("the bag was never finished (metadata.yaml is missing)")
        else:
            raise ToolError(
                f"{path} is not a bag: it has neither metadata.yaml nor a .mcap or .db3 file"
            )
    elif path.suffix not in STORAGES:
        raise ToolError(f"{path} is not a bag: give the folder of a bag, or its .mcap or .db3 file")
    readers: list[Reader] = []
    for file in files:
        try:
            readers.append(_open_file(file, stack, troubles))
        except Exception as error:
            troubles.append(f"{file.name} cannot be read: {_in_a_line(error)}")
    repair = f"`ros2 bag reindex {path if path.is_dir() else path.parent}` may repair it"
    if not readers:
        raise ToolError(f"{path} cannot be read: {'; '.join(troubles)}; {repair}")
    return readers, [f"{trouble}: {repair}" for trouble in troubles]


def _open_file(file: Path, stack: ExitStack, troubles: list[str]) -> Reader:
    """Open a file of a bag. If it is incomplete or has a journal, repair it in a copy first."""
    broken = file.suffix == ".mcap" and salvage.breaks_off(file)
    whole = file
    if broken or salvage.has_journal(file):
        make_whole = salvage.cut_to_records if broken else salvage.with_journal
        whole = make_whole(file, Path(stack.enter_context(TemporaryDirectory())))
    reader = stack.enter_context(Reader(whole))
    if broken:
        troubles.append(f"the file {file.name} is incomplete; the report covers its undamaged part")
    return reader


def _in_a_line(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".")
