# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Geometry of poses in the plane and of wheels, without bytes or times."""
