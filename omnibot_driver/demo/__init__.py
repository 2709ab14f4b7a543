# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The demo: simulated board and driver as separate processes, and a robot that drives a square.

Like any ROS program it uses the driver by its topics. It uses the simulator by its console. It must
not know the bytes on the wire.
"""
