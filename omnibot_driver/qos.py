# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Qualities of service that topics and services of every board share."""

from typing import Final

from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A value that a later subscriber receives too."""
DEEP: Final = QoSProfile(depth=1000)
"""Messages and calls of which none may be lost while the driver is busy.

A queue of 10, as is usual, loses the older ones: a released button would wipe out its press.
"""
