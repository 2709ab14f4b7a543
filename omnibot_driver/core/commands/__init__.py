# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motion commands: from a received command to the packets that carry it out, and their times."""
