# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the robot moves as it is commanded."""
