# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commands that switch off a motor that is on although the server knows of no motion.

The public server may leave a motor on after a straight move (TF or TB), and both motors on if it
was restarted in a motion. No stop command switches them off. So the driver sends MCS, which writes
the speeds of both motors. After MCS, the server refuses all motions until it gets MSM.

This module knows commands and replies; it does not know when the robot is at rest.
"""

from typing import Final

from omnibot_driver.core.mart.replies import Fail, Ok
from omnibot_driver.core.mart.words import CONFLICT, MCS, MSM, Request, Word

OFF: Final = MCS.request(128, 128)
"""The request that writes "stop" to both motors."""
RELEASE: Final = MSM.request()
"""The request that ends the direct control of the motors by MCS. Without MCS, it does nothing."""

MOST_MISSES, MOST_MISSES_DISTURBED = 4, 8
"""Number of unanswered requests in a row after which the driver gives up switching off motors.

The requests are MCS, which writes the motors' speeds, and MSM, which ends the effect of MCS.

``MOST_MISSES``: limit in a network that answers other requests.

``MOST_MISSES_DISTURBED``: limit in a network that loses other replies, too. The limit is higher,
because the network may have lost all requests or replies: if the network loses one datagram of
five, four requests in a row stay unanswered once in sixty times.
"""
NO_MCS: Final = (
    "the server does not answer MCS, so the driver cannot switch off a motor that the server leaves"
    " on after a straight move: if the robot creeps, command a turn on the spot, or cut the"
    " motor power"
)


class SwitchOff:
    """What remains to be done until the motors are off and the server accepts motions.

    ``needed``: whether a motor may be on.

    ``underway``: whether MCS (direct control of the motors) may be in progress, so that the server
    refuses motions.
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

        The driver then tries MCS (direct control of the motors), even if the server did not answer
        MCS before: the network may have lost the replies.
        """
        self.needed = not self._refused

    def begins(self, *, straight: bool) -> None:
        """Record that a motion begins.

        The motion sets the speeds of both motors. So a motor that the server had left on needs no
        MCS (the command that switches off the motors) any more.

        ``straight``: whether it is a straight controlled move, after which a motor may stay on.
        """
        self.needed = straight and self._supported

    def refused(self) -> None:
        """Record that the server has refused a request, perhaps because MCS is in progress."""
        self.underway = True

    def next(self) -> Request:
        """Return the next request: OFF if a motor may be on, otherwise RELEASE.

        OFF is the command MCS, which writes "stop" to both motors and makes the server refuse
        motions. RELEASE is MSM, after which the server accepts motions again.
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

        After MOST_MISSES unanswered requests in a row (MOST_MISSES_DISTURBED in a ``disturbed``
        network), the driver stops repeating the request, and allows motions again. If the request
        was MCS, the driver gives up MCS until the next connection or a call of ``doubt``. The
        result is then True, but not again before MCS is answered or a new connection begins.

        The server may execute an unanswered MCS later. The server then refuses the next motion, and
        the driver sends MSM, which ends the direct control by MCS.
        """
        self._misses += 1
        if self._misses < (MOST_MISSES_DISTURBED if disturbed else MOST_MISSES):
            return False
        self.needed = self.underway = False
        self._misses = 0
        gives_up = word is MCS and self._supported
        self._supported = self._supported and not gives_up
        return gives_up
