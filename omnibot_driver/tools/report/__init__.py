# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Report on a drive, from a bag or from a running robot, as a page with pictures and as text.

``bag`` and ``live`` pass messages to ``recorder``, which returns a ``log`` of columns. ``judge``
collects the findings of ``rhythm``, ``sensing``, ``travel``, ``following`` and ``events``;
``plots`` draws a log, and ``page`` writes the report. Only ``live`` imports ROS.
"""
