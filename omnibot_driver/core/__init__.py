# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The core of the driver: it converts bytes and times into values.

The core does no input or output, and does not use ROS, threads or clocks. The modules here are
common to all boards. Each board has a package of its own in this folder.
"""
