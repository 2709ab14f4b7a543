# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Parameters: the rows that are common to boards, and the table of one board.

A row has a name, a default, a unit, a range and a meaning. A board's table consists of its own
rows, and of the common rows that the board can use. From a table the node declares and checks its
parameters, and ``make docs`` writes config/<board>.yaml and docs/parameters.md. A new common row
goes into ``operating`` or ``robot``; a row of a single board goes into the module beside that
board's profile. This package does not use ROS or a board; its types are plain Python types. A wrong
value raises a ParameterError that names the parameter and the allowed values.
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
