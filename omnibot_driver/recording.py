# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A recording in place of a port: the URL ``replay://bag?speed=10`` names a rosbag2.

This module does not know what the bytes mean.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl

from omnibot_driver.core.errors import LinkError, ParameterError
from omnibot_driver.core.packets import Packet

SCHEME: Final = "replay://"
RAW_TYPE: Final = "std_msgs/msg/UInt8MultiArray"
RAW_NAME: Final = "/raw_rx"


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording of a board's bytes, in one bag.

    * ``path``: the bag, a folder or a single file.
    * ``topics``: the topic of each channel.
    * ``speed``: factor of the playback speed; infinity: as fast as possible.
    * ``delay_s``: time from the start of the driver to that of the playback.
    """

    path: Path
    topics: tuple[str, ...]
    speed: float = 1.0
    delay_s: float = 5.0

    def chunks(self) -> Iterator[tuple[int, Packet]]:
        """Yield each recorded packet, with the time in ns at which it was recorded.

        Raises LinkError if the bag cannot be read to its end.
        """
        troubles: list[str] = []
        try:
            from rosbags.typesys import Stores, get_typestore

            from omnibot_driver.bag_files import messages, open_bag

            types = get_typestore(Stores.ROS2_JAZZY)
            with ExitStack() as stack:
                readers, troubles = open_bag(self.path, stack)
                for reader in readers:
                    for source, at_ns, message in messages(reader, self.topics, troubles):
                        content: Any = types.deserialize_cdr(message, RAW_TYPE)
                        yield at_ns, (self.topics.index(source.topic), content.data.tobytes())
        except Exception as error:  # a damaged bag can raise any exception
            raise self._unreadable(str(error)) from error
        if troubles:
            raise self._unreadable("; ".join(troubles))

    def _unreadable(self, why: str) -> LinkError:
        return LinkError(f"the recording {self.path} cannot be read any further: {why}")


def is_recording(url: str) -> bool:
    """Return whether the URL is that of a recording."""
    return url.lower().startswith(SCHEME)


def open_recording(url: str, channels: Sequence[str] = ("",)) -> Recording:
    """Return the recording that the URL names.

    ``channels``: names of the board's channels. The bag must have a topic for at least one of them.
    Raises ParameterError if the URL or the bag is wrong.
    """
    location, _, query = url[len(SCHEME) :].partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    speed = _number(url, "speed", options.pop("speed", "1"), 0.01, math.inf)
    delay_s = _number(url, "delay", options.pop("delay", "5"), 0.0, 3600.0)
    topic = options.pop("topic", "")
    if options:
        known = "speed, delay and topic"
        raise _refusal(url, f"there is no option '{next(iter(options))}', only {known}")
    path = Path(location)
    return Recording(path, _find_topics(url, path, topic, channels), speed, delay_s)


def _find_topics(url: str, path: Path, wanted: str, channels: Sequence[str]) -> tuple[str, ...]:
    try:
        import rosbags.rosbag2  # noqa: F401
    except ImportError as error:
        raise ParameterError(
            f"port '{url}' needs the Python library rosbags: `pip install --user"
            " --break-system-packages rosbags` (in a virtual environment `pip install rosbags`)"
        ) from error
    if not path.exists():
        raise _refusal(url, f"there is no {path.absolute()}; give the folder of a bag")
    from omnibot_driver.bag_files import open_bag

    try:
        with ExitStack() as stack:
            readers, troubles = open_bag(path, stack)
            topics = {(each.topic, each.msgtype) for bag in readers for each in bag.connections}
    except Exception as error:  # rosbags can raise any exception
        readers, troubles = [], [str(error)]
    if not readers:
        raise _refusal(url, f"{path} is not a readable bag: {'; '.join(troubles)}")
    raw = sorted(topic for topic, kind in topics if kind == RAW_TYPE)
    names = [f"/{name}" if name else "" for name in channels]
    found = {
        topic.removesuffix(name)
        for name in names
        for topic in raw
        if topic.endswith(name if wanted else f"{RAW_NAME}{name}") and wanted in ("", topic)
    }
    if wanted and any(names):
        found = {topic for topic in found if topic.endswith(RAW_NAME)}
    if len(found) == 1:
        (home,) = found
        return tuple(home + name for name in names)
    if not raw:
        advice = "; ".join(["record with `publish_raw: true`", *troubles])
        raise _refusal(url, f"the bag has no topic {RAW_NAME[1:]}; {advice}")
    if not found and (not wanted or wanted in raw):
        missing = " or ".join(f"{RAW_NAME[1:]}{name}" for name in names)
        received = [topic for topic in raw if RAW_NAME in topic] or raw
        raise _refusal(
            url,
            f"this board needs a topic {missing}, but the bag has {', '.join(received)}; check the"
            " parameter `board`, or choose a topic with topic=",
        )
    raise _refusal(url, f"choose one of the bag's topics with topic={' or topic='.join(raw)}")


def _number(url: str, name: str, text: str, low: float, high: float) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not low <= number <= high:
        raise _refusal(url, f"{name} must be {low:g} to {high:g}, not {text!r}")
    return number


def _refusal(url: str, why: str) -> ParameterError:
    return ParameterError(f"port '{url}' is not valid: {why}")
