# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The properties of a kind of board that the fault campaign needs.

The values are in ``<board>_board.py``.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, cast

Sent = Callable[[Any], list[bytes]]


@dataclass(frozen=True, kw_only=True)
class RigBoard:
    """A kind of board in the fault campaign.

    ``ports``: takes the name of the port, and returns the driver's port parameters.

    ``old_command``: the bytes of a motion command, with which tests fill the port.

    ``stop``: the last bytes that the board gets when a driver ends.

    ``opening``: the first bytes that the board gets after its port is opened.

    ``tuning``: names of the parameters whose invalid values the driver must reject.

    ``off_within_s``: longest time from the driver's stop command until the motors are off.

    ``old_bytes_s``: time that the board needs to receive all old commands from a full port.

    ``ends_later_s``: extra time for the driver's end, beyond the usual limit.

    ``rests_later_s``: extra time for the robot to come to rest after several simultaneous faults.

    ``deaf_s``: longest time for which the board may ignore its input.

    ``silent_s``: longest usual time between two transmissions of the board.

    ``jump_stddevs``: allowed correction of predicted odometry, in standard deviations of the pose.

    ``sent``: returns the frames of the board's last tick.

    ``not_sent``: returns one tuple for each kind of message: the name of the kind, the number of
    published messages that the board has not sent, and the number of all published messages.

    ``lossy``: returns the settings of the n-th board behind a lossy line.

    ``line``, ``serve``: functions that make the board's line and its server.

    ``cases``: returns the faults of the n-th round.

    ``steps``: the faults from which a random walk chooses.

    ``without``: faults and parts of the campaign that do not apply to this board.

    In ``line``, ``serve``, ``cases`` and ``steps``, ``None`` means the default for a simulated
    serial line.
    """

    name: str
    make: Callable[[Any], Any]
    parameters: Mapping[str, object] = field(default_factory=dict)
    ports: Callable[[str], Mapping[str, str]] = lambda link: {"port": link}
    old_command: bytes
    stop: bytes
    opening: bytes
    wheels: int
    services: frozenset[str]
    tuning: tuple[str, ...]
    off_within_s: float = 0.0
    old_bytes_s: float = 0.0
    ends_later_s: float = 0.0
    rests_later_s: float = 0.0
    deaf_s: float = 0.0
    silent_s: float = 0.0
    imu: bool
    jump_stddevs: float = 0.0
    sent: Sent = lambda _board: []
    not_sent: Callable[[Iterable[Any], Iterable[Any], list[bytes]], list[tuple[str, int, int]]] = (
        lambda _imu, _odom, _sent: []
    )
    lossy: Callable[[int], Any] = lambda _number: None
    line: Callable[[Any, Any], Any] | None = None
    serve: Callable[[Any, str], Any] | None = None
    port: Callable[[Path], str] = lambda folder: str(folder / "omnibot")
    cases: Callable[[int], Mapping[str, Any]] | None = None
    steps: Mapping[str, Any] | None = None
    without: frozenset[str] = frozenset()


def load(name: str) -> RigBoard:
    """Return the properties of the board with this name."""
    return cast(RigBoard, import_module(f"{name}_board").BOARD)
