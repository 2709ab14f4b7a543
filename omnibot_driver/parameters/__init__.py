# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every parameter that is common to boards: name, default, unit, range, meaning; and the table of
one board, made of those that it can use and its own.

From a table the node declares and checks, and ``make docs`` writes config/<board>.yaml and
docs/parameters.md. A new common row goes into ``operating`` or ``robot``, one of a single board
beside that board's profile. Knows no ROS and no board; types are plain Python's. Wrong values are
ParameterErrors that name the parameter and what it may be.
"""

from omnibot_driver.parameters.parameter import Parameter, Value
from omnibot_driver.parameters.settings import session_settings
from omnibot_driver.parameters.table import Check, Table, nearest, table

__all__ = [
    "Check",
    "Parameter",
    "Table",
    "Value",
    "nearest",
    "session_settings",
    "table",
]
