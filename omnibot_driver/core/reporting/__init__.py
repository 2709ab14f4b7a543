# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reports to the user about the driver: notices, figures and diagnostic statuses."""
