# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Check, in real time, that the robot stops while the line loses bytes on the way to the board.

The losses continue until the end of the test. In simulated time, test/integrity/outbound.py
measures the rate of failures.
"""

import signal
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Final

from breakable_line import losing
from rig import Rig
from rig_board import RigBoard
from std_srvs.srv import SetBool

GRACE_S: Final = 0.1
"""Additional time that the rig allows for each stop, in s."""
TIMED_OUT_S: Final = 1.2 - GRACE_S
ESTOPPED_S: Final = 0.3 - GRACE_S
ENDED_S: Final = 0.5 - GRACE_S
RATES: Final = (1e-2, 5e-2)
GUARD_S: Final = 1.5
"""Additional time in s that a driver may take to end: it may wait while its guard repeats Stop."""


def losing_rig(folder: Path, kind: RigBoard, number: int, **more: float) -> Rig:
    """Return a rig with a new driver and a line that is not damaged yet.

    ``number``: selects the settings of the board, for example how its receiver finds frames.
    """
    return Rig(folder, kind, settings=kind.lossy(number), **more)


def lose(rig: Rig, number: int) -> None:
    """Begin to lose bytes on the way to the board. ``number`` selects the rate and the bytes."""
    rig.line.to_board = losing(RATES[number % len(RATES)], Random(number))


def times_out(rig: Rig) -> None:
    """Stop publishing commands. After the timeout, the robot must be at rest."""
    rig.drive()
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "timeout", TIMED_OUT_S)


def is_estopped(rig: Rig) -> None:
    """Latch the e-stop while commands continue. The robot must stop."""
    rig.drive()
    since = rig.line.tick
    answer = rig.probe.call(SetBool, "estop", data=True)
    rig.findings.expect(answer.success, "the e-stop was refused")
    rig.expect_still(since, "e-stop", ESTOPPED_S)
    rig.hand.leave()
    rig.probe.call(SetBool, "estop", data=False)
    rig.expect_still(since, "e-stop released", ESTOPPED_S)


def _ends(by: signal.Signals, exit_code: int, rig: Rig) -> None:
    rig.drive()
    since = rig.line.tick
    rig.driver.process.send_signal(by)
    rig.expect_ended(exit_code, late_s=GUARD_S)
    rig.wait_ticks(150)  # by then all that the guard writes is on the line
    rig.expect_still(since, f"the driver ends by {by.name}", ENDED_S)
    rig.hand.leave()


def is_interrupted(rig: Rig) -> None:
    """Interrupt the driver, as ctrl-C does. The robot must stop."""
    _ends(signal.SIGINT, 0, rig)


def is_killed(rig: Rig) -> None:
    """Kill the driver. Its guard must stop the robot."""
    _ends(signal.SIGKILL, -signal.SIGKILL, rig)


LIVES: Final[tuple[dict[str, Callable[[Rig], None]], ...]] = (
    {"timeout": times_out, "ctrl-C": is_interrupted},
    {"e-stop": is_estopped, "SIGKILL": is_killed},
)
"""Ways to stop the robot, in groups. One driver performs all stops of a group, one after the other.
The last stop of each group also ends the driver."""
