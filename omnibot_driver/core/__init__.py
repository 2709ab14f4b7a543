# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver without ROS, ports, threads or clocks: bytes and times in, values out.

Nothing in here does input or output. This package holds what all boards have in common; each board
has a package of its own below it.
"""
