# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Callbacks for the topics that command the robot: they pass each message on to the link."""

import contextlib
import time
from collections.abc import Callable
from typing import Any

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.session import Session
from omnibot_driver.stall_detector import boot_time_ns
from omnibot_driver.transit import Arrival, Transit

MessageInfo = dict[str, int]
Action = Callable[[Session, Any, float], None]


def obeying(
    link: Any,
    topic: str,
    action: Action,
    expires_s: Callable[[], float],
    *,
    may_be_old: Callable[[Any], bool] = lambda _message: False,
    is_stop: Callable[[Any], bool] = lambda _message: False,
    ends_goal: Callable[[Any], bool] = lambda _message: False,
    moves_base: bool = True,
) -> Callable[[Any, MessageInfo], None]:
    """Return a callback that passes each message to ``action``, and refuses old messages.

    * ``expires_s``: returns the age, in s, at which a command expires.
    * ``may_be_old``: returns True if the age of a message does not matter.
    * ``is_stop``: returns True for a command to stop, which is passed on at any age.
    * ``ends_goal``: returns True if a refused message must still end the drive to a goal; may raise
      CommandRefused.
    """
    transit = Transit()

    def callback(message: Any, info: MessageInfo) -> None:
        longest_s, now_ns = expires_s(), time.time_ns()
        arrival = Arrival(
            sent_ns=info["source_timestamp"],
            received_ns=info["received_timestamp"] or now_ns,  # not every middleware has this time
            now_ns=now_ns,
            steady_ns=boot_time_ns(),
            number=info.get("publication_sequence_number"),
        )
        delay = transit.delay(arrival, longest_s)

        def obey(session: Session, message: Any, now: float) -> None:
            if not (may_be_old(message) or is_stop(message)):
                delay.require(topic, longest_s)
            action(session, message, now)

        sent_ns = () if is_stop(message) else delay.sent_ns
        try:
            link.command(obey, message, sent_ns, moves_base=moves_base)
        except CommandRefused:
            with contextlib.suppress(CommandRefused):
                # A goal does not expire, and the sender may not repeat this message.
                if ends_goal(message):
                    link.call(Session.end_goal)

    return callback
