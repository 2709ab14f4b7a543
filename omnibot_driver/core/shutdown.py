# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The end of a connection: stop, see the robot stand, say the last words.

Must not know bytes, nor how long anybody waits.
"""

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.interlocks import Interlocks
from omnibot_driver.core.commands.policy import CommandPolicy
from omnibot_driver.core.mode_manager import ModeManager
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.requests import OnExit


class Shutdown:
    """``begin`` it, wait for ``stands``, ``fall_silent``, wait again; then write ``sequence``."""

    def __init__(
        self, board: Board, mode_manager: ModeManager, policy: CommandPolicy, interlocks: Interlocks
    ) -> None:
        self._board, self._mode_manager = board, mode_manager
        self._policy, self._interlocks = policy, interlocks

    def begin(self, now: float) -> None:
        """Refuse everything, and repeat Stop."""
        self._interlocks.leaving = True
        self._board.leave()
        self._policy.halt(now)

    @property
    def stands(self) -> bool:
        """The board has shown that the robot stands, and no motion was commanded since."""
        return self._policy.proof.proved

    @property
    def proof_takes_s(self) -> float:
        """How long to wait until the robot is seen to stand, from Stop on."""
        return self._policy.proof.takes_s

    def fall_silent(self, now: float) -> bool:
        """Stop is not repeated any more: the last one may have been damaged, so it is proved anew.

        Whether the board can show that.
        """
        if self._board.mode is not Mode.NOMINAL or self._policy.latched:
            return False
        if not self._board.shows_standstill:
            return False
        self._policy.fall_silent(now)
        return True

    def sequence(self, on_exit: OnExit, now: float) -> Packets:
        """The last packets to write before the port is closed."""
        proved = self._policy.quiet and self.stands
        packets = self._mode_manager.shutdown_sequence(on_exit, proved=proved)
        self._policy.discard(now)
        return packets + self._estop_again()

    def broken_off(self) -> Packets:
        """What is to follow a write that failed half-way, before the port is closed."""
        return self._board.wake() + self._estop_again()

    def _estop_again(self) -> Packets:
        return self._board.emergency_stop() if self._policy.latched else NO_PACKETS
