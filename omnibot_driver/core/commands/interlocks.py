# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the robot may be driven, or its gyro calibrated, now: if not, why, and what to do.

Each answer is a sentence, empty when nothing is in the way. Knows modes and phases.
"""

from omnibot_driver.core.board import Mode
from omnibot_driver.core.commands.set_points import Setpoint
from omnibot_driver.core.mode_manager import Phase


def why_not_drive(
    phase: Phase, mode: Mode, *, latched: bool, unheard_s: float, interlock: str
) -> str:
    """``unheard_s``: for so long nothing was heard from the board; 0 where that does not matter.

    ``interlock``: why the motion monitor refuses motion, empty where it does not.
    """
    if latched:
        return "the e-stop is latched; release it with the service ~/estop (data: false)"
    if phase is not Phase.SETTLED:
        hint = "; the service ~/start makes it run" if phase is Phase.PAUSING else ""
        return f"the board is {phase.value}{hint}"
    if not mode.running:
        return f"the board is {mode.value}; the service ~/start makes it run"
    if unheard_s:
        return f"nothing was heard from the board for {unheard_s:g} s"
    return interlock


def why_not_calibrate(
    phase: Phase, mode: Mode, current: Setpoint | None, *, measuring: bool
) -> str:
    """``current``: what is commanded; ``measuring``: a calibration is under way."""
    if phase is Phase.CLOSED:
        return "the port is not open; connect the board, then call again"
    if mode is Mode.UNKNOWN:
        return "nothing was understood from the board: check its power and cable, then call again"
    if not mode.running:
        return f"the board is {mode.value}; call ~/start, then call again"
    if measuring:
        return "a calibration is under way; wait for its answer, then call again"
    if current is not None and not current.is_zero:
        return (
            f"the robot is commanded by {current.authority.value}; stop the sender, then call again"
        )
    return ""
