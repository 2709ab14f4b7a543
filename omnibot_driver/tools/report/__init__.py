# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a drive was like, from a bag or from a robot that is listened to: a page, pictures, words.

``recorder`` turns messages into a ``log`` of columns; ``bag`` and ``live`` feed it. ``judge`` asks
``rhythm``, ``sensing``, ``travel``, ``following`` and ``events`` what a log tells; ``plots`` draws
it and ``page`` writes. Only ``live`` imports ROS.
"""
