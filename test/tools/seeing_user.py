# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated user who watches the robot's wheels, and who tilts the robot as the tool requests."""

from omnibot_driver.simulator.omnibot import PtyBoard

LOOKED_AT = 150
"""Number of control ticks that the user looks at before answering how the wheels turned.

These are the last ticks before the answer. They contain the end of the motion, and the standstill
after it.
"""


class User:
    """A user who answers the tool's questions. The first answers are those in the list ``wrong``.

    All later answers describe how the wheels really turned.
    """

    def __init__(self, port: PtyBoard, *wrong: str) -> None:
        self._port, self._wrong = port, list(wrong)
        self._seen: list[tuple[float, float, float]] = []
        self._step = port.board.step
        port.board.step = self._look  # type: ignore[method-assign]

    def _look(self) -> bytes:
        sent = self._step()
        self._seen.append(self._port.board.rim_speeds_mps)
        return sent

    def __call__(self, question: str) -> str:
        with self._port.lock:
            seen, self._seen = self._seen, []
            self._port.board.hold()
            if "A, B, C" in question:
                return self._wrong.pop(0) if self._wrong else _pattern(seen[-LOOKED_AT:])
            if "front" in question:
                self._port.board.hold(pitch_rad=-0.5, roll_rad=0.05)
            elif "left side" in question:
                self._port.board.hold(roll_rad=0.6)
            elif "to the left" in question:
                self._port.board.hold(yaw_rate=0.6)
        return "y"


def _pattern(speeds: list[tuple[float, float, float]]) -> str:
    means = [sum(column) / len(speeds) for column in zip(*speeds, strict=True)]
    most = max(map(abs, means))
    return "".join("0" if abs(mean) < 0.1 * most else "+-"[mean < 0] for mean in means)
