# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The core of the driver: it converts bytes and times into values.

It does no input or output, and knows neither ROS nor threads nor clocks. Each board has its own
package here.
"""
