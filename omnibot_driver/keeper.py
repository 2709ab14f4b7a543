# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver's side of `guard.py`: keeps a guard process running while a port is open.

The guard watches the thread that calls ``beat``. This module does not know boards.
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
"""Shortest time between two restarts of a guard, in s."""
HANGS_AFTER: Final = 50
"""Number of unread heartbeats at which the guard is regarded as hung."""
MOST_DYING: Final = 3
"""Largest number of killed guards that have not ended yet. At this number, the driver does not
start another guard."""
LEAVES_WITHIN_S: Final = 0.5
DIES_WITHIN_S: Final = 1.0
"""Longest wait for a killed guard to end, in s. A guard that takes longer is in an uninterruptible
sleep, so the driver stops waiting."""
SPEAKS_WITHIN_S: Final = guard.TIMES * guard.PACE_S + 1.5
"""Longest wait, in s, until a guard has sent its repeated stop commands and has ended.

It includes the time that a slow guard process needs to start.
"""


class Keeper:
    """The guard process for a set of open lines, from construction until ``end``.

    * ``descriptors``: file descriptor of each line, by channel; None if the line is not open.
    * ``stop``, ``emergency_stop``: packets that the guard sends without and with a latched e-stop.
    """

    def __init__(
        self, descriptors: Sequence[int | None], stop: Packets, emergency_stop: Packets
    ) -> None:
        self._trouble = ""
        self._descriptors = descriptors
        self.last_words = stop, emergency_stop
        self._ahead = 0
        """Number of bytes of stop commands that the guard may not have read yet. All other unread
        bytes are heartbeats."""
        self._process: subprocess.Popen[bytes] | None = None
        self._dying: list[subprocess.Popen[bytes]] = []
        """Killed processes that have not ended yet."""
        self._broken = False
        self._restart_at = -math.inf
        self._told: set[str] = set()
        self._start()

    def beat(self, now: float, *, latched: bool = False) -> str:
        """Send the guard a heartbeat. Call this method every 0.1 s.

        Returns a sentence for the user at the first failure of a guard or of its start; otherwise
        "".
        """
        self._dying = [process for process in self._dying if process.poll() is None]
        word = guard.LATCHED_BEAT if latched else guard.BEAT
        if self._process is not None and (trouble := self._beat(self._process, word)):
            self._tell("failed", f"{trouble}; starting another guard process")
        if self._process is None and now >= self._restart_at and len(self._dying) < MOST_DYING:
            self._restart_at = now + RESTART_S
            self._start()
        trouble, self._trouble = self._trouble, ""
        return trouble

    def change(self, stop: Packets, emergency_stop: Packets) -> None:
        """Send the guard new stop commands, without waiting for any process."""
        self.last_words = stop, emergency_stop
        if (process := self._process) is None:
            return
        assert process.stdin is not None
        message = guard.WORDS + " ".join(map(self._addressed, self.last_words)).encode() + guard.END
        try:
            os.write(process.stdin.fileno(), message)
            self._ahead += len(message)
        except OSError:  # the guard ended or hangs; the next one gets these commands
            self._give_up(process)

    def end(self, *, stopped: bool, written: bool = False) -> None:
        """End the guard, so that only this process holds the port. A second call does nothing.

        * ``stopped``: whether the robot is already stopped. If not, the guard first stops it.
        * ``written``: whether the driver wrote its last packets. If not, the guard discards unsent
          output before it stops the robot.
        """
        self._restart_at = math.inf
        if stopped:
            self._dismiss(guard.BYE, LEAVES_WITHIN_S)
        else:
            self._dismiss(guard.WRITTEN if written else b"", SPEAKS_WITHIN_S)
        until = time.monotonic() + DIES_WITHIN_S
        for process in self._dying:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, until - time.monotonic()))

    def _beat(self, process: subprocess.Popen[bytes], word: bytes) -> str:
        """Send the guard a heartbeat; return the reason if the guard has failed, otherwise "".

        If the guard has died or hangs, the keeper gives it up, and kills the process if it still
        runs.
        """
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
                self._broken = True  # the pipe closes a moment before the exit code is available
                return ""
            self._give_up(process)
            return f"the guard process died (exit code {process.returncode})"
        self._give_up(process)
        return "the guard process hung"

    def _give_up(self, process: subprocess.Popen[bytes]) -> None:
        """Kill the guard without waiting for its end.

        Waiting would delay the e-stop, because the caller holds the lock of the session.
        """
        assert process.stdin is not None
        process.stdin.close()
        process.kill()
        self._dying.append(process)
        self._process, self._broken = None, False

    def _addressed(self, packets: Packets) -> str:
        """Return the packets for open lines as a text for the guard (``DESCRIPTOR:HEX,...``)."""
        return ",".join(
            f"{line}:{data.hex()}"
            for channel, data in packets
            if (line := self._descriptors[channel]) is not None
        )

    def _start(self) -> None:
        self._ahead = 0
        # The command must not contain `omnibot_driver`, so that `pkill -f omnibot_driver` does not
        # kill the guard. For this reason guard.py is given without its folder, and the link to the
        # interpreter in a .venv is resolved. The guard needs built-in modules only.
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
            self._tell("missing", f"cannot start the guard process ({error}): {WITHOUT_GUARD}")
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

    def _tell(self, kind: str, trouble: str) -> None:
        """Report the first trouble of each kind.

        A guard that died is one kind; a guard that could not be started is another.
        """
        if kind not in self._told:
            self._told.add(kind)
            self._trouble = "; ".join(filter(None, (self._trouble, trouble)))


WITHOUT_GUARD: Final = "if the driver is killed, the robot continues with its last command"
