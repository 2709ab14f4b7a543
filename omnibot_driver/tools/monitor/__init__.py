# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A running driver on one screen of a terminal, and the keys that start, stop and steer it.

It knows the driver as any ROS program does, by topics and services. It must not know the wire.
"""
