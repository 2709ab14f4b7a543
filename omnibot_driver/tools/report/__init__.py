# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reports on a drive, from a bag or from a running robot, as a page with pictures and as text.

Flow of the data: ``bag`` or ``live`` -> ``recorder`` -> ``log`` -> ``judge``, ``plots`` ->
``page``. Only ``live`` needs ROS.
"""
