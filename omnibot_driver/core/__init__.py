# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The core of the driver: it converts bytes and times into values.

It does no input or output, and uses no ROS, threads or clocks.
"""
