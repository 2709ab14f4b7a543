# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""ROS 2 driver for the motor boards of mobile robots."""
