# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Clocks that stamp readings: they estimate sampling times from arrival times."""
