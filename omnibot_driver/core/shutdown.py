# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The shutdown of a connection: stop, wait until the robot is at rest, send the last packets.

This module must not know bytes, nor how long the caller waits.
"""

from typing import Final

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.interlocks import Interlocks
from omnibot_driver.core.commands.policy import CommandPolicy
from omnibot_driver.core.mode_manager import ModeManager, Phase
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.requests import OnExit

LAST_STOPS: Final = 3
"""Number of Stop frames sent in a row before the port is closed, because one can be lost."""


class Shutdown:
    """The steps of a shutdown, in the order of their calls.

    * Call ``begin``; wait until ``stands``.
    * Call ``fall_silent``; if True, wait until ``stands`` again.
    * Write the packets of ``sequence``.
    """

    def __init__(
        self, board: Board, mode_manager: ModeManager, policy: CommandPolicy, interlocks: Interlocks
    ) -> None:
        self._board, self._mode_manager = board, mode_manager
        self._policy, self._interlocks = policy, interlocks

    def begin(self, now: float) -> None:
        """Refuse all further commands and requests, and repeat Stop."""
        self._interlocks.leaving = True
        self._board.leave()
        self._policy.halt(now)

    @property
    def stands(self) -> bool:
        """Whether the robot was shown to stand still, and no motion was commanded since then."""
        return self._policy.proof.proved

    @property
    def owed(self) -> bool:
        """Whether motion was commanded, and no proof of a stop has come since then."""
        return self._policy.proof.owed

    @property
    def proof_takes_s(self) -> float:
        """Time to wait for the proof that the robot stands still, counted from Stop, in s."""
        return self._policy.proof.takes_s

    def fall_silent(self, now: float) -> bool:
        """End the repetition of Stop, and demand a new proof that the robot stands still.

        Return False, and change nothing, if no proof is possible or the e-stop is latched.
        """
        if self._board.mode is not Mode.NOMINAL or self._policy.latched:
            return False
        if not self._board.shows_standstill:
            return False
        self._policy.fall_silent(now)
        return True

    def sequence(self, on_exit: OnExit, now: float) -> Packets:
        """Return the last packets to write before the port is closed."""
        stops = 0 if self._policy.quiet and self.stands else LAST_STOPS
        packets = (
            stops * self._board.stop() + self._last_request(on_exit) + self._board.switch_off()
        )
        self._policy.discard(now)
        return packets + self._estop_again()

    def broken_off(self) -> Packets:
        """Return the packets to write before the port is closed, if the last write was incomplete.

        These packets end the incomplete command, stop the wheels and, if the e-stop is latched,
        repeat the emergency stop.
        """
        return self._board.wake() + self._estop_again()

    def _last_request(self, on_exit: OnExit) -> Packets:
        settled = self._mode_manager.phase is Phase.SETTLED
        if on_exit == "reset":
            return self._board.reset()
        if on_exit == "pause" and settled and self._board.mode.running:
            return self._board.pause()
        if on_exit == "pause" and not (settled and self._board.mode is Mode.PAUSED):
            return self._board.force_pause()
        return NO_PACKETS

    def _estop_again(self) -> Packets:
        return self._board.emergency_stop() if self._policy.latched else NO_PACKETS
