# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What every simulated board shares: real time, the lines to it, and their faults.

Knows no board.
"""
