# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Events that a session returns: values only."""

from dataclasses import dataclass

from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimator import OdometryEstimate
from omnibot_driver.core.requests import RequestDone


@dataclass(frozen=True, slots=True)
class StateChanged:
    """``Session.state`` or ``Session.estop_active`` is another than before: what they are now."""

    state: str
    estop_active: bool


@dataclass(frozen=True, slots=True)
class Notice:
    """A notice for the user, as a sentence."""

    text: str


@dataclass(frozen=True, slots=True)
class Extra:
    """Something that this board alone measures: any value of a type that its profile publishes.

    ``stamp_s``: when it was measured.
    """

    value: object
    stamp_s: float


Event = ImuEstimate | OdometryEstimate | StateChanged | RequestDone | Notice | Extra
