# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From arrival times to sampling times."""
