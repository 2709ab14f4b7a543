# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a kind of board has and can do: chosen at construction, never asked for each frame."""

from dataclasses import dataclass

from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.requests import Request


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """Constant for a board while the driver runs.

    ``imu``: whether it sends ImuReadings; ``authorities``: who may command motion; ``requests``:
    what else can be asked of it; ``wheels``: names of those that ``wheel_cmd`` turns, in its order;
    ``unheard_s``: a robot that is not heard for so long is driven no further; ``silence_s``: after
    it a board that says nothing is not known to be there.
    """

    imu: bool
    authorities: frozenset[Authority]
    requests: frozenset[Request]
    wheels: tuple[str, ...] = ()
    unheard_s: float
    silence_s: float
