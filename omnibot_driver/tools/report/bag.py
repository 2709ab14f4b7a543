# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reads a rosbag2 without ROS: its folder or one file, sqlite3 or mcap, also compressed."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from omnibot_driver.bag_files import STORAGES, messages, open_bag
from omnibot_driver.tools.needs import ToolError
from omnibot_driver.tools.report.findings import counted
from omnibot_driver.tools.report.log import Log
from omnibot_driver.tools.report.recorder import Recorder
from omnibot_driver.tools.report.robots import choose, find

METADATA: Final = "metadata.yaml"
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
            found = messages(reader, topics.keys(), troubles)
            for count, (item, arrived_ns, data) in enumerate(found, recorder.count + damaged):
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
    return recorder.log(tuple(troubles), topics=topics.values(), alone=len(robots) == 1)


def _open(path: Path, stack: ExitStack) -> tuple[list[Reader], list[str]]:
    """Return readers of all files that can be opened, and a text about each defect of the bag."""
    if not path.exists():
        raise ToolError(f"there is no {path}: give the folder of a bag, or its .mcap or .db3 file")
    if path.is_dir():
        if not any(file.name == METADATA or file.suffix in STORAGES for file in path.iterdir()):
            raise ToolError(
                f"{path} is not a bag: it has neither {METADATA} nor a .mcap or .db3 file"
            )
    elif path.suffix not in STORAGES:
        raise ToolError(f"{path} is not a bag: give the folder of a bag, or its .mcap or .db3 file")
    readers, troubles = open_bag(path, stack)
    repair = f"`ros2 bag reindex {path if path.is_dir() else path.parent}` may repair it"
    if not readers:
        raise ToolError(f"{path} cannot be read: {'; '.join(troubles)}; {repair}")
    return readers, [f"{trouble}: {repair}" for trouble in troubles]
