# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Shows a running driver on a terminal, with keys that start, stop and steer the robot.

The monitor uses the driver's topics and services. It must not know the board's protocol.
"""
