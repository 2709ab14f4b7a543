# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the fault campaign must know of each kind of board.

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
    """A kind of board in the campaign.

    ``make``: makes a simulated board from settings, or from None.

    ``parameters``: the driver's parameters for this board.

    ``ports``: takes the path of the link to the terminal, and returns the parameters that name the
    board's ports.

    ``old_command``: the bytes of a motion command.

    ``stop``: the last bytes that the board must receive when a driver ends.

    ``opening``: the first bytes that the board must receive on a new line.

    ``wheels``: the number of values in wheel_cmd.

    ``services``: the common services that the board's driver has.

    ``tuning``: parameters that must refuse invalid values.

    ``off_within_s``: longest allowed time from a stop until the motors are off.

    ``old_bytes_s``: how long the board takes to receive all old commands from a full port.

    ``ends_later_s``: additional time that the driver may take to end.

    ``deaf_s``: longest time for which the board may ignore its input. The driver then has to repeat
    commands.

    ``silent_s``: longest usual pause between two transmissions of the board.

    ``imu``: whether the board has an IMU.

    ``jump_stddevs``: how much predicted odometry may be corrected, in standard deviations of the
    prediction.

    ``sent``: returns the frames of the board's last tick.

    ``not_sent``: returns for each kind of message how many published ones were never sent, and how
    many were published.

    ``lossy``: takes a number, and returns the settings of a board on a line that loses bytes.

    ``line``: makes the line. None means a breakable line of bytes.

    ``serve``: makes the server of the line. None means a terminal.

    ``port``: takes a folder, and returns the driver's ``port``.

    ``cases``: takes the number of a round, and returns the faults of the round. None means the
    usual faults of a serial line.

    ``without``: names of the faults and parts of the campaign that do not apply to the board.
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
    without: frozenset[str] = frozenset()


def load(name: str) -> RigBoard:
    """Return the campaign's values for the board with this name."""
    return cast(RigBoard, import_module(f"{name}_board").BOARD)
