# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The demo: simulated board and driver as processes of their own, and a robot that drives a square.

It knows the driver as any ROS program does, by its topics, and the simulator by its console. It
must not know the wire.
"""
