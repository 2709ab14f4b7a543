# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry: from displacements and the board's own poses to the pose of the robot."""
