# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tools for a robot's users: they talk to a running driver or read its bags."""
