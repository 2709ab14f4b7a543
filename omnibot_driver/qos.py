# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Qualities of service that topics and services of every board share."""

from typing import Final

from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Quality of service of a topic whose last value is also sent to later subscribers."""
DEEP: Final = QoSProfile(depth=1000)
"""Quality of service of messages and calls that must not be lost while the driver is busy."""
