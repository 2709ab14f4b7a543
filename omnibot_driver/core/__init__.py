# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver without ROS, ports, threads or clocks: bytes and times in, values out.

Everything in here is a pure function of its arguments. What is common to all boards lives in this
package, what is known of one board in a package of its own below it.
"""
