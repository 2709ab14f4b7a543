# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Estimates how long a command without a stamp was in transit, from its time of sending.

The middleware reports the time of sending by the sender's clock.

difference = arrival by our clock - sending by the sender's clock;
offset = the sender's smallest difference;
delay = difference - offset.

Reasons: docs/internals/stopping.md. This module must not read a clock or use ROS.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.errors import CommandRefused

HEALS_AFTER_S: Final = 5.0
LONGEST_SILENCE_S: Final = 2.0
"""Longest pause, in s, within a series of late messages.

If the series lasts ``HEALS_AFTER_S`` (s), the driver estimates the offset of the sender's clock
anew.
"""
LARGEST_DRIFT: Final = 5e-4
"""Largest assumed drift between two clocks, in s per s. It is the highest rate at which NTP
corrects a clock."""
LARGEST_CORRECTION_S: Final = 0.4
LASTING_DRIFT: Final = 1e-4
"""Largest assumed long-term drift between two clocks, in s per s, caused by their crystals.

NTP can shift a clock gradually by ``LARGEST_CORRECTION_S`` (s) in addition, but steps a clock with
a larger error.
"""
CLOCK_RETREATS: Final = 10.0
"""Factor by which a message that is early by a sender's clock fits this sender worse than a late
one. The driver assigns each message to the sender that it fits best."""
ALIKE_S: Final = 0.02
"""Largest difference, in s, between the misfits of two senders that fit a message equally well.

The driver then chooses the sender whose last message had the highest sequence number.
"""
MOST_SENDERS: Final = 8
KNOWN_AFTER: Final = 10
"""Number of messages after which the offset of a sender's clock is regarded as known. If there are
fewer messages, all of them may have been delayed."""

Differences = tuple[float, float]
"""Arrival minus sending, in s: arrival by this computer's time of day, and by its steady clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """The times of one message, in ns.

    * ``sent_ns``: time of day by the sender's clock.
    * ``received_ns``, ``now_ns``: times of day by our clock.
    * ``steady_ns``: present time by our steady clock.
    * ``number``: the message's number at its sender. None if the middleware does not count.
    """

    sent_ns: int
    received_ns: int
    now_ns: int
    steady_ns: int
    number: int | None = None


@dataclass(frozen=True, slots=True)
class Delay:
    """The age of a message, and the time at which it was sent.

    * ``total_s``: time since the message was sent.
    * ``waited_s``: part of this time in our own queue.
    * ``sent_ns``: possible times of day at which the message was sent: an estimate by our clock,
      and, while the offset of the sender's clock is unknown, a second time by the sender's clock.
    """

    total_s: float
    waited_s: float
    sent_ns: tuple[int, ...] = ()

    def require(self, topic: str, longest_s: float) -> None:
        """Raise CommandRefused if the command is older than ``longest_s``."""
        if self.total_s <= longest_s:
            return
        if 2 * self.waited_s > self.total_s:
            where = (
                f"it waited {self.waited_s:.1f} s in this driver's queue: check the load of this"
                " computer"
            )
        else:
            where = "check the network, and the load and the clock of the sending computer"
        raise CommandRefused(
            f"{topic} refused: it was sent {self.total_s:.1f} s ago, and commands expire after"
            f" {longest_s:g} s (cmd_vel_timeout); {where}"
        )


class Transit:
    """An estimator of the delays of messages on one topic, from all senders."""

    def __init__(self) -> None:
        self._senders: list[_Sender] = []

    def delay(self, arrival: Arrival, longest_s: float) -> Delay:
        """Return the delay of this message, estimated from earlier messages of its sender.

        A sender's first message is assumed to have no delay in transit.

        ``longest_s``: a message with a longer delay is late.
        """
        waited_ns = max(0, arrival.now_ns - arrival.received_ns)
        at_s = (arrival.steady_ns - waited_ns) / 1e9
        # If both computers' times of day jump, only the second difference changes. If only our
        # time of day jumps, only the first changes. So the smaller delay is used.
        differences_s = (
            (arrival.received_ns - arrival.sent_ns) / 1e9,
            (arrival.steady_ns - waited_ns - arrival.sent_ns) / 1e9,
        )
        late_s = self._late_s(arrival.number, differences_s, at_s, longest_s)
        total_s = late_s + waited_ns / 1e9
        sent_ns = arrival.now_ns - round(total_s * 1e9)
        known = self._senders[-1].heard >= KNOWN_AFTER
        return Delay(total_s, waited_ns / 1e9, (sent_ns,) if known else (sent_ns, arrival.sent_ns))

    def _late_s(
        self, number: int | None, differences_s: Differences, at_s: float, longest_s: float
    ) -> float:
        # The middleware reports the number of a message, but not its sender.
        possible = [sender for sender in self._senders if sender.may_send(number)]
        if not possible:
            self._senders = [*self._senders[1 - MOST_SENDERS :], _Sender(differences_s, at_s)]
            self._senders[-1].number = number
            return 0.0
        misfits_s = {sender: sender.misfit_s(differences_s, at_s) for sender in possible}
        limit_s = ALIKE_S + min(largest_s for _, largest_s in misfits_s.values())
        sender = max(
            (sender for sender in possible if misfits_s[sender][0] <= limit_s),
            key=lambda sender: (sender.number or 0, -misfits_s[sender][0]),
        )
        self._senders.remove(sender)
        self._senders.append(sender)  # the sender that was silent for longest is forgotten first
        sender.number = number
        return sender.hear(differences_s, at_s, longest_s)


class _Sender:
    """A sender on a topic, with the offset of each of our two clocks from the sender's clock.

    Our two clocks are the time of day and the steady clock.
    """

    def __init__(self, differences_s: Differences, at_s: float) -> None:
        self.number: int | None = None
        self.heard = 1
        self._offsets = [_Offset(difference_s, at_s) for difference_s in differences_s]

    def may_send(self, number: int | None) -> bool:
        """Return whether message ``number`` can be from this sender; True if the number is unknown.

        The numbers of a sender's messages increase.
        """
        return number is None or self.number is None or self.number < number

    def misfit_s(self, differences_s: Differences, at_s: float) -> tuple[float, float]:
        """Return how badly a message fits this sender: least and largest possible misfit in s.

        The misfit is the time by which the message is late, or ``CLOCK_RETREATS`` times the time by
        which it is early.
        """
        misfits_s = [
            offset.misfit_s(difference_s, at_s)
            for offset, difference_s in zip(self._offsets, differences_s, strict=True)
        ]
        return min(least for least, _ in misfits_s), min(most for _, most in misfits_s)

    def hear(self, differences_s: Differences, at_s: float, longest_s: float) -> float:
        self.heard += 1
        return min(
            offset.hear(difference_s, at_s, longest_s)
            for offset, difference_s in zip(self._offsets, differences_s, strict=True)
        )


class _Offset:
    """The offset of one clock of this computer (time of day or steady clock) from a sender's clock.

    The offset is the smallest recent difference (arrival minus sending). It follows the drift
    between the two clocks.
    """

    def __init__(self, difference_s: float, at_s: float) -> None:
        self._least_s, self._least_at_s = difference_s, at_s
        self._late_at_s = -math.inf
        self._late_since_s = self._least_late_s = math.inf

    def late_s(self, difference_s: float, at_s: float) -> float:
        """Return the least time in s by which a message is late; negative if it may be in time.

        ``difference_s``: arrival by our clock minus sending by the sender's clock.
        """
        return difference_s - self._least_s - self._drift_s(at_s)

    def misfit_s(self, difference_s: float, at_s: float) -> tuple[float, float]:
        """Return how badly a message fits this offset: least and largest possible misfit in s.

        The misfit is the time by which the message is late, or ``CLOCK_RETREATS`` times the time by
        which it is early.
        """
        excess_s, drift_s = difference_s - self._least_s, self._drift_s(at_s)
        weight = 1.0 if excess_s >= 0.0 else CLOCK_RETREATS
        return weight * max(0.0, abs(excess_s) - drift_s), weight * (abs(excess_s) + drift_s)

    def _drift_s(self, at_s: float) -> float:
        passed_s = max(0.0, at_s - self._least_at_s)
        return min(LARGEST_DRIFT * passed_s, LARGEST_CORRECTION_S + LASTING_DRIFT * passed_s)

    def hear(self, difference_s: float, at_s: float, longest_s: float) -> float:
        late_s = self.late_s(difference_s, at_s)
        if late_s > longest_s:
            return self._hear_late(difference_s, at_s, late_s)
        self._late_at_s = -math.inf
        if late_s <= 0.0:
            self._least_s, self._least_at_s = difference_s, at_s
        return max(0.0, late_s)

    def _hear_late(self, difference_s: float, at_s: float, late_s: float) -> float:
        if at_s - self._late_at_s > LONGEST_SILENCE_S:
            self._late_since_s, self._least_late_s = at_s, math.inf
        self._late_at_s = at_s
        self._least_late_s = min(self._least_late_s, difference_s)
        if at_s - self._late_since_s < HEALS_AFTER_S:
            return late_s
        # All messages are late since the sender's clock was set back, or the network became slow.
        # The two cases look the same.
        self._late_at_s = -math.inf
        self._least_s, self._least_at_s = self._least_late_s, at_s
        return difference_s - self._least_s
