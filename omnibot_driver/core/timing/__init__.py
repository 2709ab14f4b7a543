# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Clocks that stamp readings: sampling times, estimated from arrival times."""
