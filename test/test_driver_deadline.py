# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A test of the deadline for the driver's shutdown."""

import pytest

from omnibot_driver import driver


def test_without_a_thread_for_its_deadline_a_shutdown_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At the limit of processes no thread can be started. The shutdown continues without deadline.

    Otherwise the driver would end without a stop, and only the guard would stop the robot.
    """

    def refuse(_timer: object) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("threading.Timer.start", refuse)
    driver._set_deadline()
