# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Qualities of service that topics and services of every board share."""

from typing import Final

from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A value that a later subscriber receives too."""
CALLS: Final = QoSProfile(depth=1000)
"""Calls of a service, none of which is lost: rclpy's own depth of 10 loses the oldest ones."""
