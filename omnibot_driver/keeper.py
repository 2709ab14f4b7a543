# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Keeps a guard beside an open port: the driver's side of `guard.py`.

It starts the process, beats for it, replaces it when it dies, and sends it away. It knows no
threads and no board; its user calls ``beat`` from the thread that must stay alive.
"""

import contextlib
import fcntl
import math
import os
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Sequence
from typing import Final

from omnibot_driver import guard
from omnibot_driver.core.packets import Packets

BEAT_S: Final = 0.1
RESTART_S: Final = 1.0
"""A guard that dies at once is not started more often than this."""
HANGS_AFTER: Final = 50
"""A guard that has missed this many beats would not stop the robot either."""
MOST_DYING: Final = 3
"""Number of killed guards that have not ended yet, above which no other is started."""
LEAVES_WITHIN_S: Final = 0.5
DIES_WITHIN_S: Final = 1.0
"""One that is killed and does not is in an uninterruptible sleep; the driver does not wait for
that."""
SPEAKS_WITHIN_S: Final = guard.TIMES * guard.PACE_S + 1.5
"""On a busy computer a process takes its time to start, and what it says is the stop."""


class Keeper:
    """A guard for open lines, from now until ``end``.

    ``descriptors``: of the lines, by channel, None for one that is missing; ``stop``,
    ``emergency_stop``: what the guard is to say, by whether the e-stop is latched.
    """

    def __init__(
        self, descriptors: Sequence[int | None], stop: Packets, emergency_stop: Packets
    ) -> None:
        self._trouble = ""
        self._descriptors = descriptors
        self.last_words = stop, emergency_stop
        self._ahead = 0
        """Bytes of words that the guard may not have read yet."""
        self._process: subprocess.Popen[bytes] | None = None
        self._dying: list[subprocess.Popen[bytes]] = []
        """Killed, and not gone yet."""
        self._broken = False
        self._restart_at = -math.inf
        self._told = False
        self._start()

    def beat(self, now: float, *, latched: bool = False) -> str:
        """The driver is alive; call it every ``BEAT_S``, neither more nor less often.

        Returns a sentence, once, when the guard is not as it should be. Waits for no process.
        """
        self._dying = [process for process in self._dying if process.poll() is None]
        word = guard.LATCHED_BEAT if latched else guard.BEAT
        if self._process is not None and (trouble := self._beat(self._process, word)):
            self._tell(f"{trouble}; starting another one")
        if self._process is None and now >= self._restart_at and len(self._dying) < MOST_DYING:
            self._restart_at = now + RESTART_S
            self._start()
        trouble, self._trouble = self._trouble, ""
        return trouble

    def change(self, stop: Packets, emergency_stop: Packets) -> None:
        """What the guard is to say from now on. Waits for no process."""
        self.last_words = stop, emergency_stop
        if (process := self._process) is None:
            return
        assert process.stdin is not None
        message = guard.WORDS + " ".join(map(self._addressed, self.last_words)).encode() + guard.END
        try:
            os.write(process.stdin.fileno(), message)
            self._ahead += len(message)
        except OSError:  # gone, or it reads nothing: another one is started with these words
            self._give_up(process)

    def end(self, *, stopped: bool) -> None:
        """It leaves, and the port is ours alone; harmless to repeat.

        Unless the robot is known to have been ``stopped``, it says its last words first.
        """
        self._restart_at = math.inf
        if stopped:
            self._dismiss(guard.BYE, LEAVES_WITHIN_S)
        else:
            self._dismiss(b"", SPEAKS_WITHIN_S)
        until = time.monotonic() + DIES_WITHIN_S
        for process in self._dying:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, until - time.monotonic()))

    def _beat(self, process: subprocess.Popen[bytes], word: bytes) -> str:
        """Returns what is wrong with it, and then it is given up."""
        assert process.stdin is not None
        pipe = process.stdin.fileno()
        try:
            (unread,) = struct.unpack("i", fcntl.ioctl(pipe, termios.FIONREAD, bytes(4)))
            self._ahead = min(self._ahead, unread)
            if unread - self._ahead < HANGS_AFTER * len(word):
                os.write(pipe, word)
                return ""
        except OSError:
            if process.poll() is None and not self._broken:
                self._broken = True  # its pipe closes a moment before its exit code is there
                return ""
            self._give_up(process)
            return f"the guard process died (exit code {process.returncode})"
        self._give_up(process)
        return "the guard process hung"

    def _give_up(self, process: subprocess.Popen[bytes]) -> None:
        """Kill it. It may be in an uninterruptible sleep, so later beats look whether it is gone.

        The e-stop goes through the lock that is held here.
        """
        assert process.stdin is not None
        process.stdin.close()
        process.kill()
        self._dying.append(process)
        self._process, self._broken = None, False

    def _addressed(self, packets: Packets) -> str:
        """Encode the last words for the guard, without the lines that are missing."""
        return ",".join(
            f"{line}:{data.hex()}"
            for channel, data in packets
            if (line := self._descriptors[channel]) is not None
        )

    def _start(self) -> None:
        self._ahead = 0
        # By its bare name: `pkill -f omnibot_driver` must not hit the guard. Nor by the name of a
        # folder with a .venv in it: there the interpreter is a link, and needed are built-ins only.
        folder, name = os.path.split(guard.__file__)
        command = [os.path.realpath(sys.executable), "-I", "-S", name]
        try:
            self._process = subprocess.Popen(
                [*command, *map(self._addressed, self.last_words)],
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[line for line in self._descriptors if line is not None],
                cwd=folder,
                start_new_session=True,  # ctrl-C is for the driver alone
            )
        except OSError as error:
            self._tell(f"cannot start the guard process ({error}): {WITHOUT_GUARD}")
            return
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)

    def _dismiss(self, word: bytes, within_s: float) -> int | None:
        if self._process is None:
            return None
        process, self._process = self._process, None
        assert process.stdin is not None
        with contextlib.suppress(OSError):
            process.stdin.write(word)
        process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(within_s)
        process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(DIES_WITHIN_S)
        return None

    def _tell(self, trouble: str) -> None:
        if not self._told:
            self._told, self._trouble = True, trouble


WITHOUT_GUARD: Final = "if the driver is killed, the robot continues with its last command"
