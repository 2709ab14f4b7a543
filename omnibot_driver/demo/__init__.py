# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The demo: a robot with a simulated board drives a square.

The demo uses the driver's topics and the simulator's console. The demo must not know the board's
protocol.
"""
