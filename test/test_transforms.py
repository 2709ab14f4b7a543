# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the publisher of transforms, with and without tf2_ros."""

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from omnibot_driver.transforms import transform_publisher


class FakeNode:
    """A node that keeps its warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.warnings.append)


def test_without_tf2_there_is_one_warning_and_no_publisher(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without tf2_ros, no transforms are published, and there is one warning.

    The warning says what to install, and how to switch transforms off.
    """
    monkeypatch.setitem(sys.modules, "tf2_ros", None)
    node = FakeNode()
    assert transform_publisher(node) is None
    (warning,) = node.warnings
    assert "ros-jazzy-tf2-ros" in warning
    assert "publish_tf" in warning


def test_with_tf2_its_broadcaster_gets_the_transforms(monkeypatch: pytest.MonkeyPatch) -> None:
    """If tf2_ros is installed, its broadcaster gets the transforms, and no warning appears."""
    sent: list[tuple[object, object]] = []

    class Broadcaster:
        def __init__(self, node: object) -> None:
            self._node = node

        def sendTransform(self, transform: object) -> None:
            sent.append((self._node, transform))

    fake = SimpleNamespace(TransformBroadcaster=Broadcaster)
    monkeypatch.setitem(sys.modules, "tf2_ros", fake)
    node = FakeNode()
    send = transform_publisher(node)
    assert send is not None
    send("transform")
    assert sent == [(node, "transform")]
    assert not node.warnings
