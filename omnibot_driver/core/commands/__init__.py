# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From a command to what goes out, and when."""
