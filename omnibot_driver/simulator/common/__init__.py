# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Code that all simulated boards share: real time, the lines to a board, and faults of these lines.

This package must not know any particular board.
"""
