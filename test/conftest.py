# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Keeps the tests' ROS traffic to this machine and to this run of them.

Hypothesis tries the same examples in every run, so what turns red was changed;
``pytest --hypothesis-profile exploring`` looks for others. None is timed.
"""

import os

from hypothesis import HealthCheck, settings

# Domains 0 to 101 are safe on every platform; 0 is everybody's default.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 101)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

settings.register_profile("exploring", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("same", settings.get_profile("exploring"), derandomize=True)
settings.load_profile("same")
