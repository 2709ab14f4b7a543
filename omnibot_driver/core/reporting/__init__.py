# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a user learns of it: notices, figures, verdicts."""
