# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A test of the deadline for the driver's shutdown."""

import pytest

from omnibot_driver import driver


def test_without_a_thread_for_its_deadline_a_shutdown_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The thread of the deadline cannot be started, and the shutdown continues without a deadline.

    If the shutdown failed instead, only the guard would stop the robot.
    """

    def refuse(_timer: object) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("threading.Timer.start", refuse)
    driver._set_deadline()
