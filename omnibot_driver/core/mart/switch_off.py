# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commands that switch off a motor that is on although the server knows of no motion.

The public server may leave motors on after a straight move (TF or TB), or if it was restarted in a
motion. Stop commands do not switch them off. MCS does, but the server then refuses all motions
until it gets MSM.

This module knows commands and replies; it does not know when the robot is at rest.
"""

from typing import Final

from omnibot_driver.core.mart.replies import Fail, Ok
from omnibot_driver.core.mart.words import CONFLICT, MCS, MSM, Request, Word

OFF: Final = MCS.request(128, 128)
"""The request that writes "stop" to both motors."""
RELEASE: Final = MSM.request()
"""The request that ends the direct control of the motors by MCS. Without MCS, it does nothing."""

# if the network loses one datagram of five, four requests in a row stay unanswered once in sixty
# times
MOST_MISSES, MOST_MISSES_DISTURBED = 4, 8
"""Number of unanswered requests (MCS, MSM) in a row after which the driver stops repeating them.

``MOST_MISSES_DISTURBED`` applies in a network that loses other replies, too.
"""
NO_MCS: Final = (
    "the server does not answer MCS, the command by which the driver switches the motors off. If"
    " the server leaves a motor on after a straight move, the robot creeps: then command a turn on"
    " the spot, or cut the motor power"
)


class SwitchOff:
    """What remains to be done until the motors are off and the server accepts motions.

    * ``needed``: whether a motor may be on.
    * ``underway``: whether MCS may be in progress, so that the server refuses motions.
    """

    def __init__(self) -> None:
        self.connect()

    def connect(self) -> None:
        """Begin a new connection.

        Its server may support MCS (direct control of the motors), even if an earlier server did
        not.
        """
        self.needed = self.underway = False
        self._supported, self._refused = True, False
        self._misses = 0

    def doubt(self) -> None:
        """Record that a motor may be on, although the server knows of no motion.

        The driver then tries MCS, unless the server has refused MCS in this connection.
        """
        self.needed = not self._refused

    def begins(self, *, straight: bool) -> None:
        """Record that a motion begins, which sets the speeds of both motors.

        ``straight``: whether the motion is a straight controlled move, after which a motor may stay
        on.
        """
        self.needed = straight and self._supported

    def refused(self) -> None:
        """Record that the server has refused a request, perhaps because MCS is in progress."""
        self.underway = True

    def next(self) -> Request:
        """Return the next request: OFF if a motor may be on, otherwise RELEASE.

        After OFF, the server refuses motions until RELEASE.
        """
        return OFF if self.needed else RELEASE

    def sent(self) -> None:
        """Record that the request returned by ``next`` was sent."""
        self.underway = True

    def answered(self, word: Word, reply: Ok | Fail) -> None:
        """Evaluate the reply to MCS (direct control of the motors) or MSM (end of this control).

        The failure CONFLICT shows that an earlier MCS has arrived and is in progress.
        """
        self.needed, self._misses = False, 0
        if isinstance(reply, Fail) and reply.reason != CONFLICT:
            self._supported, self._refused = False, self._refused or word is MCS
        elif word is MCS:
            self._supported = True
        self.underway = word is MCS and self._supported

    def missed(self, word: Word, *, disturbed: bool = False) -> bool:
        """Record that MCS or MSM was not answered; return whether the driver gives up MCS now.

        After MOST_MISSES in a row (MOST_MISSES_DISTURBED in a ``disturbed`` network), the driver
        stops repeating the request, and allows motions. ``connect`` or ``doubt`` allows MCS again.
        """
        self._misses += 1
        if self._misses < (MOST_MISSES_DISTURBED if disturbed else MOST_MISSES):
            return False
        # if an unanswered MCS is executed later, the server refuses the next motion, and MSM
        # follows
        self.needed = self.underway = False
        self._misses = 0
        gives_up = word is MCS and self._supported
        self._supported = self._supported and not gives_up
        return gives_up
