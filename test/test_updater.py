# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of diagnostics with and without the library diagnostic_updater."""

import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from omnibot_driver.core.reporting.status import Level, Status
from omnibot_driver.diagnostics import _through_updater


class Wrapper:
    """An imitation of the object into which a task of diagnostic_updater writes its status."""

    def __init__(self) -> None:
        self.values: dict[str, str] = {}

    def summary(self, level: bytes, message: str) -> None:
        self.said = level, message

    def add(self, key: str, value: str) -> None:
        self.values[key] = value


class Updater:
    """An imitation of diagnostic_updater's ``Updater``.

    ``force_update`` runs all tasks, and appends their statuses to ``reports``.
    """

    def __init__(self, node: object, period_s: float) -> None:
        self.period = 2 * period_s  # a parameter may change the period
        self.node, self.hardware_id, self.keeps_ros_time = node, "", True
        self.timer = SimpleNamespace(cancel=lambda: setattr(self, "keeps_ros_time", False))
        self.tasks: list[tuple[str, Callable[[Wrapper], Wrapper]]] = []
        self.reports: list[list[tuple[str, bytes, str, dict[str, str]]]] = []

    def setHardwareID(self, hardware_id: str) -> None:
        self.hardware_id = hardware_id

    def add(self, name: str, task: Callable[[Wrapper], Wrapper]) -> None:
        self.tasks.append((name, task))

    def force_update(self) -> None:
        done = [(name, task(Wrapper())) for name, task in self.tasks]
        self.reports.append([(name, *one.said, one.values) for name, one in done])


def test_without_the_updater_it_is_done_without(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without diagnostic_updater, the driver publishes the diagnostics without a warning."""
    monkeypatch.setitem(sys.modules, "diagnostic_updater", None)
    assert _through_updater(SimpleNamespace(), "/dev/omnibot") is None


def test_with_the_updater_each_status_is_a_task_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """diagnostic_updater gets one task for each status. The task fills in the newest values.

    The library sets the period of the reports.
    """
    made: list[Any] = []

    def make(node: object, period_s: float) -> Updater:
        made.append(Updater(node, period_s))
        return made[0]

    fake = SimpleNamespace(Updater=make)
    monkeypatch.setitem(sys.modules, "diagnostic_updater", fake)
    found = _through_updater(node := SimpleNamespace(), "/dev/omnibot")
    assert found is not None
    publish, period_s = found
    (updater,) = made
    assert (updater.node, updater.hardware_id, updater.keeps_ros_time) == (
        node,
        "/dev/omnibot",
        False,
    )
    assert period_s == updater.period
    imu = Status("IMU", Level.OK, "fine", {})
    publish([Status("Link", Level.OK, "connected", {"Reconnects": "0"}), imu])
    publish([Status("Link", Level.ERROR, "lost", {"Reconnects": "1"}), imu])
    fine = ("IMU", b"\x00", "fine", {})
    assert updater.reports == [
        [("Link", b"\x00", "connected", {"Reconnects": "0"}), fine],
        [("Link", b"\x02", "lost", {"Reconnects": "1"}), fine],
    ]
