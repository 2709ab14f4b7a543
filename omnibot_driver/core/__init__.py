# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The core of the driver: it converts bytes and times into values.

The core has no input or output, and uses no ROS, threads or clocks. Each board has its own package.
"""
