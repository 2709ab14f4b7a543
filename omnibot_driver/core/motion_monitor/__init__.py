# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The motion monitor: checks whether the robot moves as it is commanded."""
