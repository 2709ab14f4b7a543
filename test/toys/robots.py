# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The toys' other halves: what their robots do with what they hear, 100 times a second."""

TICK_S = 0.01


class LineRobot:
    """Two wheels that turn as they are told; it never stops by itself."""

    tick_s = TICK_S

    def __init__(self) -> None:
        self.tick = 0
        self.left = self.right = 0
        self.way_m = self.turn_rad = 0.0
        self.heard: list[bytes] = []
        self._held, self._told = b"", (0, 0)

    def receive(self, data: bytes, now: float = 0.0, channel: int = 0) -> None:
        *lines, self._held = (self._held + data).split(b"\n")
        for words in filter(None, map(bytes.split, lines)):
            self.heard.append(b" ".join(words))
            self.left, self.right = int(words[1]), int(words[2])

    def step(self) -> list[tuple[int, bytes]]:
        self.tick += 1
        self.way_m += (self.left + self.right) / 2e3 * TICK_S
        self.turn_rad += (self.right - self.left) / 1e3 / 0.4 * TICK_S
        if self.tick % 40:
            return []
        before, self._told = self._told, (round(1e3 * self.way_m), round(1e3 * self.turn_rad))
        way, turn = (now - then for now, then in zip(self._told, before, strict=True))
        return [(1, b"d %d %d\n" % (way, turn))]

    @property
    def stands(self) -> bool:
        return self.left == self.right == 0


class RequestRobot:
    """One request at a time, the others wait for their turn."""

    tick_s = TICK_S

    def __init__(self) -> None:
        self.heard: list[bytes] = []
        self.way_m = self.turn_rad = 0.0
        self._waiting: list[bytes] = []
        self._speed, self._left = (0, 0), 0
        self._told = (0, 0)

    def receive(self, data: bytes, now: float = 0.0, channel: int = 0) -> None:
        self.heard.append(data)
        if channel == 1:
            self._left, self._speed = min(self._left, 1), (0, 0)
        else:
            self._waiting.append(data)

    def step(self) -> list[tuple[int, bytes]]:
        v, w = self._speed
        self.way_m, self.turn_rad = self.way_m + v / 1e5, self.turn_rad + w / 1e5
        if self._left:
            self._left -= 1
            if self._left:
                return []
            self._speed = (0, 0)
            return [(0, b"ok")]
        if not self._waiting:
            return []
        word, *numbers = self._waiting.pop(0).split()
        if word == b"MOVE":
            self._speed, self._left = (int(numbers[0]), int(numbers[1])), 20
            return []
        before, self._told = self._told, (round(1e3 * self.way_m), round(1e3 * self.turn_rad))
        way, turn = (now - then for now, then in zip(self._told, before, strict=True))
        return [(0, b"at %d %d" % (way, turn))]

    @property
    def stands(self) -> bool:
        return self._speed == (0, 0)
