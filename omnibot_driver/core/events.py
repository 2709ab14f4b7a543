# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The events that a session returns: values without behaviour."""

from dataclasses import dataclass

from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.requests import RequestDone


@dataclass(frozen=True, slots=True)
class StateChanged:
    """A change of ``Session.state`` or ``Session.estop_active``, with the new value of both."""

    state: str
    estop_active: bool


@dataclass(frozen=True, slots=True)
class Notice:
    """A notice for the user, as a sentence."""

    text: str


@dataclass(frozen=True, slots=True)
class Extra:
    """A measurement that only one kind of board makes; its profile publishes it.

    ``stamp_s``: time of measurement, in s of the host's steady clock. If ``value`` is
    a RequestDone or Unstamped, it is published without a stamp.
    """

    value: object
    stamp_s: float


Event = ImuEstimate | OdometryEstimate | StateChanged | RequestDone | Notice | Extra
