# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Report on a drive, from a bag or from a running robot: a page, pictures, words.

``recorder`` turns messages into a ``log`` of columns; ``bag`` and ``live`` feed it. ``judge``
collects the findings of ``rhythm``, ``sensing``, ``travel``, ``following`` and ``events``;
``plots`` draws a log, and ``page`` writes the report. Only ``live`` imports ROS.
"""
