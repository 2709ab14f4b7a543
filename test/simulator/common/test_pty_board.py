# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a board with one serial line, in real time behind a real pseudo-terminal."""

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.common.running import UNREAD_LIMIT
from omnibot_driver.simulator.common.serving import PtyBoard

PATIENCE_S = 20.0


class Ticker:
    """A board that sends its tick number in each tick, as 26 bytes.

    ``sent`` holds all bytes sent.
    """

    channels, tick_s = (Channel(),), 0.01

    def __init__(self) -> None:
        self.tick = 0
        self.sent = bytearray()

    def receive(self, data: bytes, now: float, channel: int) -> None:
        """Ignore all input."""

    def advance(self) -> list[Packet]:
        self.tick += 1
        said = b"%25d\n" % self.tick
        self.sent += said
        return [(0, said)]

    def reboot(self) -> None:
        """Do nothing: this board never boots."""

    @property
    def facts(self) -> dict[str, object]:
        return {"tick": self.tick}


def all_of(port: int) -> Iterator[bytes]:
    """Yield all bytes that a terminal holds, in pieces.

    One read may return only a part of the bytes.
    """
    with suppress(BlockingIOError):
        while data := os.read(port, 8192):
            yield data


@pytest.mark.slow
def test_bytes_that_nobody_reads_are_dropped_and_counted() -> None:
    """A terminal that no program reads keeps the oldest bytes; later ones are dropped and counted.

    The test allows twice ``UNREAD_LIMIT``, because a busy kernel counts bytes late.
    """
    with PtyBoard(Ticker()) as pty:
        assert pty.wait_for(lambda board: pty.dropped > 100, PATIENCE_S)
        port = os.open(pty.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            with pty.lock:
                sent = bytes(pty.board.sent)
                held = len(sent) - pty.dropped
                data = b"".join(all_of(port))
        finally:
            os.close(port)
    assert len(data) == held < 2 * UNREAD_LIMIT
    assert sent.startswith(data)


class Clock:
    """A replacement of the computer's clock. It advances only when the board waits or computes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 0.0
        self.at_ticks: list[float] = []
        time_of_clock = SimpleNamespace(monotonic=lambda: self.now_s)
        monkeypatch.setattr("omnibot_driver.simulator.common.running.time", time_of_clock)
        monkeypatch.setattr(
            "omnibot_driver.simulator.common.serving.select", SimpleNamespace(select=self.wait)
        )

    def wait(
        self, _read: object, _write: object, _error: object, timeout_s: float
    ) -> tuple[list[int], list[int], list[int]]:
        """Replace ``select``: advance the clock by the timeout, and report that nothing arrived."""
        self.now_s += timeout_s
        return [], [], []

    def board(self, cost_s: Callable[[int], float]) -> Ticker:
        """Return a board whose n-th tick takes ``cost_s(n)`` to compute."""
        clock = self

        class SlowBoard(Ticker):
            def advance(self) -> list[Packet]:
                clock.at_ticks.append(clock.now_s)
                packets = super().advance()
                clock.now_s += cost_s(self.tick)
                return packets

        return SlowBoard()


def test_a_slow_machine_delays_ticks_but_does_not_make_the_time_drift(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every 50th tick takes 25 ms to compute, longer than a tick.

    The 999th tick still begins at 9.99 s.
    """
    clock = Clock(monkeypatch)
    board = clock.board(lambda tick: 0.025 if tick % 50 == 0 else 0.003)
    with PtyBoard(board) as pty:
        assert pty.wait_for(lambda board: board.tick >= 999, PATIENCE_S)
    assert clock.at_ticks[998] == pytest.approx(9.99)


def test_a_long_standstill_is_not_made_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """The computer sleeps for an hour.

    The board then continues at one tick per 10 ms, not faster.
    """
    clock = Clock(monkeypatch)
    with PtyBoard(clock.board(lambda tick: 3600.0 if tick == 10 else 0.0)) as pty:
        assert pty.wait_for(lambda board: board.tick >= 30, PATIENCE_S)
    assert clock.at_ticks[29] - clock.at_ticks[11] == pytest.approx(0.18)


def test_waiting_for_what_does_not_come_ends_with_false() -> None:
    """A test waits 0.05 s for a condition that is never true. The wait returns False."""
    with PtyBoard(Ticker()) as pty:
        assert not pty.wait_for(lambda board: False, 0.05)


def test_a_dead_board_is_reported_to_whoever_waits_and_on_exit() -> None:
    """If a board's thread has failed, waiting for the board and closing it raise RuntimeError."""

    class BrokenBoard(Ticker):
        def advance(self) -> list[Packet]:
            raise ZeroDivisionError

    pty = PtyBoard(BrokenBoard())
    pty.__enter__()
    with pytest.raises(RuntimeError) as waiting:
        pty.wait_for(lambda board: False, PATIENCE_S)
    with pytest.raises(RuntimeError) as on_exit:
        pty.__exit__(None, None, None)
    assert isinstance(waiting.value.__cause__, ZeroDivisionError)
    assert isinstance(on_exit.value.__cause__, ZeroDivisionError)


@pytest.mark.usefixtures("nothing_left_behind")
def test_no_thread_and_no_descriptor_is_left_behind() -> None:
    """A board is closed. No thread and no file descriptor of it remain in the process."""
    with PtyBoard(Ticker()) as pty:
        assert pty.wait_for(lambda board: board.tick > 2, PATIENCE_S)


def test_a_link_leads_to_the_terminal_and_goes_with_it(tmp_path: Path) -> None:
    """The symbolic link to the terminal exists as long as the board runs."""
    link = tmp_path / "board"
    with PtyBoard(Ticker(), str(link)) as pty:
        assert os.readlink(link) == pty.path
    assert not link.is_symlink()


def test_a_dead_link_is_replaced(tmp_path: Path) -> None:
    """A simulator replaces the symbolic link that a killed simulator has left behind."""
    link = tmp_path / "board"
    link.symlink_to("/dev/pts/no-such-terminal")
    with PtyBoard(Ticker(), str(link)) as pty:
        assert os.readlink(link) == pty.path


def test_a_link_that_was_taken_over_is_left_alone(tmp_path: Path) -> None:
    """A second simulator replaces the symbolic link of the first simulator.

    When the first simulator ends, the link of the second simulator is not removed.
    """
    link = tmp_path / "board"
    with PtyBoard(Ticker(), str(link)):
        second = PtyBoard(Ticker(), str(link))
        second.__enter__()
    try:
        assert os.readlink(link) == second.path
    finally:
        second.__exit__(None, None, None)


@pytest.mark.parametrize("kind", ["file", "link to a file"])
def test_a_real_file_is_never_replaced_by_a_link(tmp_path: Path, kind: str) -> None:
    """The simulator never replaces a file, or a link to a file, with its own link.

    The error says what to do, and no file descriptor stays open.
    """
    precious = tmp_path / "precious"
    precious.write_text("data")
    link = precious
    if kind == "link to a file":
        link = tmp_path / "link"
        link.symlink_to(precious)
    before = len(os.listdir("/proc/self/fd"))
    with (
        pytest.raises(FileExistsError, match="choose another name"),
        PtyBoard(Ticker(), str(link)),
    ):
        pass
    assert precious.read_text() == "data"
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_link_that_cannot_be_made_is_named_with_what_to_do(tmp_path: Path) -> None:
    """The folder of the symbolic link does not exist.

    The error message names the link and says what to do.
    """
    with (
        pytest.raises(FileNotFoundError, match=r"nowhere/board .*choose a folder that exists"),
        PtyBoard(Ticker(), tmp_path / "nowhere/board"),
    ):
        pass
