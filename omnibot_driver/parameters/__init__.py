# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Parameters: the rows that are common to boards, and the table of one board.

``make docs`` writes config/<board>.yaml and docs/parameters.md from the tables. New common rows
belong in ``operating`` or ``robot``, a board's own rows beside the board's profile. This package
knows neither ROS nor a board.
"""

from omnibot_driver.parameters.parameter import RANGE_TYPES, Parameter, Value
from omnibot_driver.parameters.settings import session_settings
from omnibot_driver.parameters.table import Check, Table, nearest, table

__all__ = [
    "RANGE_TYPES",
    "Check",
    "Parameter",
    "Table",
    "Value",
    "nearest",
    "session_settings",
    "table",
]
