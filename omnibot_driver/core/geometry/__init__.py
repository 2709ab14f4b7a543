# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Poses in the plane and wheels: pure geometry."""
