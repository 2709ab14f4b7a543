# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A random test: requests, commands and faults of the line in any order.

The tests check rules that must always hold, for example that only fresh commands move the robot.
"""

import contextlib
from collections import deque
from dataclasses import dataclass
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from session_bench import EMERGENCY_STOP, PAUSE, STOP, TICK_S, ZEROS, Bench

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.packets import joined
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.simulator.omnibot import BoardMode, BoardSettings

RUNNING = ("nominal", "imu_only")
TIMEOUT_S = 0.5
LIMITS_S = {Request.START: 5.0, Request.PAUSE: 5.0, Request.RESET: 10.0}
WANTED = {Request.START: BoardMode.NOMINAL, Request.PAUSE: BoardMode.PAUSED}


@dataclass
class Asked:
    request: Request
    at: float


class Walk(Bench):
    """A bench that checks each write of the driver. Its line is slow and may lose bytes."""

    def __init__(self, seed: int, latency_s: float, board: BoardSettings, *, run: bool) -> None:
        super().__init__(board, run=run)
        self.random = Random(seed)
        self.latency_s = latency_s
        self.loses = 0.0
        self.to_board: deque[tuple[float, bytes]] = deque()
        self.from_board: deque[tuple[float, bytes]] = deque()
        self.commanded_at: float | None = None
        self.asked: dict[object, Asked] = {}
        self.wanted = BoardMode.NOMINAL if run else None
        self.meddled_at = self.now
        self.estop_written_at = self.now

    # What happens

    def settle(self) -> None:
        if self.session.state not in RUNNING:
            self.commanded_at = None
        data = joined(self.session.take_output(self.now))
        if data:
            self.judge(data)
            self.written.append((self.now, data))
            if self.hears:
                self.to_board.append((self.now + self.latency_s, self.damaged(data)))
        for event in self.session.take_events():
            if isinstance(event, RequestDone):
                self.judge_answer(event)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.step_board()
            while self.from_board and self.from_board[0][0] <= self.now:
                self.session.inbound.receive(self.from_board.popleft()[1], self.now)
                self.settle()
            if self.now >= self.session.wake_at:
                self.session.tick(self.now)
            self.settle()
            self.judge_time()

    def stall(self, seconds: float) -> None:
        """Simulate a stall of the driver for ``seconds``. The line still carries data."""
        for _ in range(round(seconds / TICK_S)):
            self.step_board()
        if self.session.estop_active:
            self.estop_written_at = self.now

    def step_board(self) -> None:
        self.now += TICK_S
        while self.to_board and self.to_board[0][0] <= self.now:
            self.board.receive(self.to_board.popleft()[1])
        data = self.board.step()
        if data and self.speaks:
            self.from_board.append((self.now + self.latency_s, self.damaged(data)))

    def damaged(self, data: bytes) -> bytes:
        if not self.loses:
            return data
        kept = bytes(byte for byte in data if self.random.random() >= self.loses)
        if kept != data:
            self.meddled_at = self.now
        return kept

    # What is asked for

    def act(self, action: str) -> None:
        with contextlib.suppress(CommandRefused, RequestRefused):
            getattr(self, f"act_{action}")()
        self.settle()

    def act_drive(self) -> None:
        self.session_command(lambda: self.drive(0.4, 0.0, 0.166))

    def act_turn(self) -> None:
        self.session_command(lambda: self.turn_wheels(12.0, -8.0, 5.0))

    def act_stand(self) -> None:
        self.session_command(self.drive)

    def session_command(self, command: object) -> None:
        assert callable(command)
        before, self.commanded_at = self.commanded_at, self.now
        try:
            command()
        except CommandRefused:
            self.commanded_at = before
            raise

    def act_start(self) -> None:
        self.ask_for(Request.START)

    def act_pause(self) -> None:
        self.ask_for(Request.PAUSE)

    def act_reset(self) -> None:
        self.ask_for(Request.RESET)

    def ask_for(self, request: Request) -> None:
        token, running = object(), self.session.state in RUNNING
        self.asked[token] = Asked(request, self.now)
        try:
            self.session.request(request, token, self.now)
        except RequestRefused:
            del self.asked[token]
            raise
        if request is not Request.START:
            self.commanded_at = None
        if request is Request.RESET and self.wanted is None and running:
            self.wanted = BoardMode.NOMINAL
        self.wanted = WANTED.get(request, self.wanted)

    def act_estop(self) -> None:
        self.commanded_at = None
        self.session.estop(True, self.now)
        start = len(self.written)
        self.settle()
        assert self.session.state == "disconnected" or (
            self.written_since(start) or self.written[-1][1]
        ).endswith(EMERGENCY_STOP + STOP)

    def act_release(self) -> None:
        self.session.estop(False, self.now)

    def act_reboot(self) -> None:
        self.meddled_at = self.now
        self.board.reboot()

    def act_letter(self) -> None:
        """Send the board a letter, as another program would."""
        self.meddled_at = self.now
        self.board.receive(self.random.choice([b"P", b"S", b"R"]))

    def act_deafen(self) -> None:
        self.hears = False

    def act_silence(self) -> None:
        self.speaks = False

    def act_corrupt(self) -> None:
        self.loses = 0.01

    def act_heal(self) -> None:
        self.hears = self.speaks = True
        self.loses = 0.0

    def act_unplug(self) -> None:
        if self.session.state != "disconnected":
            self.commanded_at = None
            self.to_board.clear()
            self.from_board.clear()
            self.close()

    def act_plug(self) -> None:
        if self.session.state == "disconnected":
            self.estop_written_at = self.now
            self.open()

    def act_stall(self) -> None:
        self.stall(self.random.choice([0.05, 0.4, 3.0]))

    # What must hold

    def judge(self, data: bytes) -> None:
        if EMERGENCY_STOP in data:
            self.estop_written_at = self.now
        head = data.rfind(b"\xff\xfe")
        stops = (STOP[len(ZEROS) :], EMERGENCY_STOP[len(ZEROS) :])
        motion = head >= 0 and data[head:] not in stops and len(data) - head == 9
        if motion:
            assert self.session.state in RUNNING, "motion for a board that is not known to run"
            assert not self.session.estop_active, "motion under the e-stop"
            assert self.commanded_at is not None, "motion that was discarded"
            assert self.now - self.commanded_at < TIMEOUT_S, "motion after the timeout"
            assert not any(asked.request is not Request.START for asked in self.asked.values())
        if data.endswith(b"P"):
            assert data.endswith(STOP + PAUSE)
            assert self.session.state in RUNNING, "a toggle for a board that is not known to run"

    def judge_answer(self, done: RequestDone) -> None:
        asked = self.asked.pop(done.token)
        assert self.now - asked.at <= LIMITS_S[asked.request] + 3.1, "an answer after its time"
        undisturbed = self.meddled_at < asked.at - 2.0 and self.now - asked.at < 2.9
        if done.success and undisturbed and asked.request in WANTED:
            assert self.board.mode is WANTED[asked.request], "a false report of success"

    def judge_time(self) -> None:
        for asked in self.asked.values():
            assert self.now - asked.at <= LIMITS_S[asked.request], "no answer in time"
        if self.session.estop_active and self.session.state != "disconnected":
            assert self.now - self.estop_written_at < 0.07, "the e-stop is not repeated"


ACTIONS = [name.removeprefix("act_") for name in dir(Walk) if name.startswith("act_")]
STEPS = st.lists(
    st.tuples(
        st.sampled_from([*ACTIONS, "drive", "drive", "turn", "pause", "start", "heal", "plug"]),
        st.sampled_from([0.0, 0.02, 0.05, 0.2, 0.7, 1.2, 2.5]),
    ),
    min_size=5,
    max_size=40,
)


@pytest.mark.slow
@given(
    STEPS,
    st.integers(0, 2**16),
    st.sampled_from([0.0, 0.01, 0.03, 0.08]),
    st.booleans(),
    st.sampled_from([0.05, 0.3, 1.0]),
)
@settings(max_examples=15)
def test_whatever_happens_the_robot_obeys_fresh_commands_only_and_ends_in_the_wanted_mode(
    steps: list[tuple[str, float]], seed: int, latency_s: float, run: bool, boot_time_s: float
) -> None:
    """After any requests, commands and faults, the robot rests and the board has the wanted mode.

    Each request gets its answer in time. The driver sends P only when it believes that the board is
    running.
    """
    walk = Walk(seed, latency_s, BoardSettings(boot_time_s=boot_time_s, seed=seed), run=run)
    walk.open()
    for action, pause_s in steps:
        walk.act(action)
        walk.run(pause_s)
    for action in ("heal", "plug", "release"):
        walk.act(action)
    walk.run(14.0)
    assert not walk.asked
    assert walk.still()
    if walk.wanted is not None:
        assert walk.board.mode is walk.wanted
        assert walk.session.state == walk.wanted.value
    quiet = len(walk.written)
    walk.run(3.0)
    assert walk.written_since(quiet) == b""
