# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Calibration: drive the robot slowly, through its driver, to find the driver's parameters."""
