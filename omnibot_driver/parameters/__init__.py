# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Parameters: the table of one board, and the rows that boards share. Each parameter is a row.

Rows of one board are beside its profile. ``make docs`` writes config/<board>.yaml and
docs/parameters.md. This package knows neither ROS nor a board.
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
