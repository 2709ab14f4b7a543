# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From an IMU's counts to measurements without bias."""
