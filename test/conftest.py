"""Keeps the tests' ROS traffic to this machine and to this run of them."""

import os

# Domains 0 to 101 are safe on every platform; 0 is everybody's default.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 101)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
