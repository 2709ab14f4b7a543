# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From readings to measurements: stamped, checked, counted."""
