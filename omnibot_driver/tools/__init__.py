# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Programs for people who own the robot: they talk to a running driver or read its bags."""
