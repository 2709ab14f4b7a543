# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reports on a drive, from a bag or from a running robot, as a page with pictures and as text.

- ``bag`` and ``live`` receive messages. ``recorder`` turns them into columns, which form a ``log``.
- ``rhythm``, ``sensing``, ``travel``, ``following`` and ``events`` judge a log. ``judge`` collects
  their findings.
- ``plots`` draws pictures of a log, and ``page`` writes the report.

Only ``live`` needs ROS.
"""
