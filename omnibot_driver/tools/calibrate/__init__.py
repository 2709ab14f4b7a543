# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The calibration tool: it moves the robot through the driver, and measures driver parameters."""
