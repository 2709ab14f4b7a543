# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every parameter of the driver: name, default, unit, range, meaning; and what they add up to.

One table, from which the node declares and checks, and from which ``make docs`` writes
config/driver.yaml and docs/parameters.md. A new row goes into ``operating`` or ``robot``. Knows no
ROS; types are plain Python's. Wrong values are ParameterErrors that name the parameter and what it
may be.
"""

from omnibot_driver.parameters.parameter import Parameter, Value
from omnibot_driver.parameters.settings import session_settings
from omnibot_driver.parameters.table import BY_NAME, PARAMETERS, SECTIONS, check_all, nearest

__all__ = [
    "BY_NAME",
    "PARAMETERS",
    "SECTIONS",
    "Parameter",
    "Value",
    "check_all",
    "nearest",
    "session_settings",
]
