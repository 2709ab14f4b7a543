# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motion commands: which packets a received command becomes, and when they are sent."""
