# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tools for the robot's users. They communicate with a running driver, or read its bags."""
