"""Drives the robot slowly, through the driver, to find what its parameters ought to be."""
