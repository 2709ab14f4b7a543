# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the campaign needs of a kind of board, in values; a module ``<board>_board.py`` has each."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Final, cast

Sent = Callable[[Any], list[bytes]]
NOTHING: Final[Mapping[str, object]] = {}


@dataclass(frozen=True, kw_only=True)
class RigBoard:
    """``make``: a simulated one with these settings, or the usual; ``parameters``: the driver's.

    ``old_command``: bytes that drive it; ``stop``: what it hears last, however a driver ends;
    ``opening``: what it hears first on a new line. ``wheels``: how many wheel_cmd has;
    ``services``: of the common ones; ``tuning``: parameters that refuse nonsense. ``off_within_s``:
    how long after a stop its motors are off; ``old_bytes_s``: how long it takes to hear
    what a full port has kept; ``ends_later_s``: how much longer its driver takes to end;
    ``deaf_s``: how long it may miss what is said on one line, so that the next one has to tell it.
    ``silent_s``: how long it sends nothing, as a rule.
    ``imu``: whether it sends readings of one; ``jump_stddevs``: by how many of its own standard
    deviations an odometry that is predicted may be put right.

    ``ports``: the driver's parameters that name its ports, by the link to the terminal.

    ``sent``: the frames of its last tick; ``not_sent``: of what was published, by kind, how many
    messages were never sent, and of how many. ``lossy``: settings of board number n for a line that
    loses bytes. ``without``: faults that do not apply, and pieces of the campaign.

    ``line``, ``serve``, ``port``: in place of a breakable line of bytes, what carries it, and what
    the driver's ``port`` is; ``cases``: all that one driver goes through in a round, by the number
    of the round; None for what is usual on a serial line.
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
    """Load the rig of the board with this name."""
    return cast(RigBoard, import_module(f"{name}_board").BOARD)
