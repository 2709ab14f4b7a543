# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Measurements from readings: stamped, checked for plausibility, and counted."""
