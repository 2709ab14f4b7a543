# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Interlocks: whether a command, request, task or gyro calibration is possible now.

Each method ``why_not_…`` returns the reason for a refusal, with a remedy; empty if nothing is
refused.
"""

from typing import Final

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.pipeline import CommandPipeline
from omnibot_driver.core.commands.set_points import Setpoint
from omnibot_driver.core.imu.gyro_calibration import GyroCalibration
from omnibot_driver.core.liveness import Liveness
from omnibot_driver.core.mode_manager import ModeManager, Phase
from omnibot_driver.core.requests import LEAVING, Request

NOT_OPEN: Final = "the port is not open; connect the board, then call again"
REPLAY: Final = "a replay writes nothing to a board"
NO_VALID_DATA: Final = "no valid data from the board; check its power and cable, then call again"


class Interlocks:
    """The conditions under which the driver refuses commands and requests.

    * ``leaving``: whether the driver is shutting down.
    * ``missing``: which lines are not open, as a sentence; empty if none.
    * ``obeys``: False if the session replays a recording.
    """

    def __init__(
        self,
        board: Board,
        mode_manager: ModeManager,
        commanding: CommandPipeline,
        calibration: GyroCalibration,
        liveness: Liveness,
    ) -> None:
        self._board, self._mode_manager = board, mode_manager
        self._policy, self._interlock = commanding.policy, commanding.interlock
        self._calibration, self._liveness = calibration, liveness
        self.leaving = False
        self.missing = ""
        self.obeys = commanding.obeys

    def why_not_request(self) -> str:
        """Return the reason why requests are refused now; empty if they are allowed."""
        return LEAVING if self.leaving else self.missing

    def why_not_write(self) -> str:
        """Return the reason why a request is refused; empty if it is allowed.

        Call this method for requests that no data from the board can confirm. A replay refuses them
        too.
        """
        replay = "" if self.obeys else f"{REPLAY}; start the driver on the board's port"
        return self.why_not_request() or replay

    def refused(self, now: float) -> None:
        """Record that a motion command was refused; call this for every refused command.

        After the motion monitor's first stop, motion is allowed again when no command has arrived
        for ``cmd_vel_timeout``. The call restarts this time.
        """
        self._interlock.be_active(now, self._policy.settings.timeout_s)

    def why_not_drive(self, motion: Setpoint, now: float) -> str:
        """Return the reason why this motion is refused; empty if the motion is allowed.

        Call this method once for each command: each call records the arrival of a command.
        """
        if self.leaving or self.missing:
            return self.why_not_request()
        stands, phase, mode = motion.is_zero, self._mode_manager.phase, self._board.mode
        tripped = self._interlock.arrive(now, self._policy.settings.timeout_s, stands=stands)
        if self._policy.latched:
            return "the e-stop is latched; release it with the service ~/estop (data: false)"
        if mode is Mode.UNKNOWN and (refusal := self._board.refusal):
            return refusal
        if phase is not Phase.SETTLED:
            hint = "; call ~/start to run it" if phase is Phase.PAUSING else ""
            return f"the board is {phase.value}{hint}"
        if not mode.running:
            starts = Request.START in self._board.traits.requests
            hint = "; call ~/start to run it" if starts else ""
            return f"the board is {mode.value}{hint}"
        unheard_s = self._liveness.unheard_s
        if not stands and now - self._liveness.heard_at >= unheard_s:
            return f"no data from the board for {unheard_s:g} s; check its power and cable"
        if not stands and (refusal := self._board.refusal):
            return refusal
        return tripped

    def why_not_move_by_itself(self, now: float) -> str:
        """Return why a service must not move the robot, e.g. to dock it; empty if it may.

        The refusals of the motion monitor apply to such motions too.
        """
        return self._interlock.reason(now, self._policy.settings.timeout_s)

    def why_not_reset_odometry(self, now: float) -> str:
        """Return the reason why the odometry cannot be reset; empty if it can.

        While the board is silent, a reset is refused: later data could contain motion from before
        the reset.
        """
        if self._mode_manager.phase is Phase.CLOSED:
            return NOT_OPEN
        return NO_VALID_DATA if self._liveness.is_silent(now) else ""

    def why_not_task(self) -> str:
        """Return why a task of the board, such as a recording, cannot begin; empty if it can."""
        if self.leaving:
            return self.why_not_request()
        if self._mode_manager.phase is Phase.CLOSED:
            return NOT_OPEN
        if self._policy.latched:
            return "the e-stop is latched; release it, then call again"
        if not self._board.mode.running:
            return f"the board is {self._board.mode.value}; call again when it runs"
        return ""

    def why_not_calibrate(self) -> str:
        """Return the reason why the gyro's bias cannot be measured; empty if it can."""
        phase, mode, current = self._mode_manager.phase, self._board.mode, self._policy.current
        if self.leaving or self.missing:
            return self.why_not_request()
        if phase is Phase.CLOSED:
            return NOT_OPEN
        if phase is Phase.RESETTING:
            return f"the board is {phase.value}; call again when it runs"
        if mode is Mode.UNKNOWN:
            return NO_VALID_DATA
        if not mode.running:
            return f"the board is {mode.value}; call ~/start, then call again"
        if self._calibration.measuring:
            return "a calibration is under way; wait for its answer, then call again"
        if current is not None and not current.is_zero:
            return (
                f"the robot is commanded by {current.authority.value}; end these commands, then"
                " call again"
            )
        return ""
