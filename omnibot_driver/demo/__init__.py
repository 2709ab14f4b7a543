# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The demo: simulated board and driver as separate processes, and a robot that drives a square.

Like any ROS program, the demo uses the driver through the driver's topics. It uses the simulator
through the simulator's console. The demo must not know the bytes on the wire.
"""
