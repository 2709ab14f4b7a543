# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Conversion of an IMU's counts into measurements without bias."""
