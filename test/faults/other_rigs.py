# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Rigs for two special boards: one behind a network, and one under position control."""

import socket
from pathlib import Path
from typing import Any

from commander import Hand, Navigator
from ports import Server
from rig import Rig
from rig_board import RigBoard

from omnibot_driver.simulator.omnibot import BoardSettings


class NetworkRig(Rig):
    """A rig whose board is behind a server on the network."""

    def __init__(self, folder: Path, kind: RigBoard, **options: Any) -> None:
        super().__init__(folder, kind, **options)
        with socket.create_server(("127.0.0.1", 0)) as server:
            self._number = server.getsockname()[1]
        self.port = f"socket://127.0.0.1:{self._number}"

    @property
    def server(self) -> Server:
        """The server to which the driver connects."""
        assert isinstance(self._terminal, Server)
        return self._terminal

    def _make_terminal(self) -> Server:
        return Server(self.line, self._number)


class GoalRig(Rig):
    """A rig whose board is under position control.

    The board drives to goals and does not obey velocities.
    """

    def __init__(self, folder: Path, kind: RigBoard, **options: Any) -> None:
        settings = BoardSettings(control="position")
        super().__init__(folder, kind, settings=settings, control_method="position", **options)

    def make_hand(self) -> Hand:
        return Navigator(self.probe, self.odom)

    def drive(self, vx: float = 0.3, vy: float = 0.0, yaw_rate: float = 0.2) -> None:
        """Repeat a goal until the board drives to it."""
        for _ in range(50):
            self.hand.hold(vx, vy, yaw_rate)
            if self.wait_for_board(lambda line: line.board.driven, 0.2):
                return
        raise AssertionError(self.driver.output)
