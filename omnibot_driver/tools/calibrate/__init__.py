# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drives the robot slowly, through the driver, to find what its parameters ought to be."""
