# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motion commands: how a received command becomes packets, and when these are sent."""
