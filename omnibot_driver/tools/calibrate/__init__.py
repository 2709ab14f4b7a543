# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Calibration: move the robot through its driver, and measure the driver's parameters."""
