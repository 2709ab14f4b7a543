# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The guard: a separate process that stops the robot when the driver no longer can.

When heartbeats on standard input cease, it repeats the stop command, or the emergency stop if the
e-stop is latched. It must import very little.

Usage: ``python guard.py STOP EMERGENCY_STOP``. Each argument lists packets as
``DESCRIPTOR:HEX,DESCRIPTOR:HEX``. The line ``=STOP EMERGENCY_STOP`` on standard input replaces both
arguments.
"""

import _signal as signal  # type: ignore[import-not-found]  # ``signal`` imports ``enum``
import errno
import os
import select
import sys
import termios

BEAT = b"."
LATCHED_BEAT = b"e"
"""Heartbeat of a driver whose e-stop is latched."""
WORDS = b"="
END = b"\n"
"""End of a message that begins with ``WORDS``. The message contains the packets of a new stop and
of a new emergency stop, which the guard uses from then on."""
BYE = b"!"
"""Message that ends the guard. The driver sends it after it has stopped the robot itself."""
WRITTEN = b"w"
"""Last message of a driver that has written its last packets itself. The kernel may still hold
these packets, so the guard must not discard the kernel's output."""
LIMIT_S = 0.5
"""Time without a heartbeat, in s, after which the guard assumes that the driver hangs."""
TIMES = 20
PACE_S = 0.05

GONE = (errno.EBADF, errno.EIO, errno.ENODEV, errno.ENXIO, errno.EPIPE)
"""Errors of a line that no longer accepts data."""

DRIVER = 0


Words = list[tuple[int, bytes]]
"""The packets of one command, as pairs: a file descriptor, and the bytes to write to it."""


def watch(stop: Words, emergency_stop: Words) -> None:
    """Stop the robot if the driver hangs, or if the driver ends without sending ``BYE``."""
    patience_s: float | None = LIMIT_S
    latched, written, rest = False, False, b""
    while True:
        for line, _ in stop + emergency_stop:
            os.set_blocking(line, False)
        last_words = emergency_stop if latched else stop
        if not select.select([DRIVER], [], [], patience_s)[0]:
            speak(last_words, until=[DRIVER], drop=True)
            patience_s = None
        elif not (heard := os.read(DRIVER, 4096)):
            speak(last_words, until=[], drop=not written)
            return
        else:
            patience_s = LIMIT_S
            beats, given, rest = parted(rest + heard)
            if BYE in beats:
                return
            if given:
                stop, emergency_stop = map(words, given.decode().split(" "))
            written = WRITTEN in beats
            if beats := beats.replace(WRITTEN, b""):
                latched = beats.endswith(LATCHED_BEAT)


def parted(heard: bytes) -> tuple[bytes, bytes, bytes]:
    """Split the received bytes into heartbeats, the newest stop commands and a partial message."""
    beats = given = b""
    while WORDS in heard:
        before, _, after = heard.partition(WORDS)
        beats += before
        whole, end, heard = after.partition(END)
        if not end:
            return beats, given, WORDS + after
        given = whole
    return beats + heard, given, b""


def speak(last_words: Words, until: list[int], drop: bool) -> None:
    """Write the packets of ``last_words`` to their lines, 20 times.

    Return early if all lines are lost, or if a message comes from ``until``: the driver then runs
    again. ``drop``: whether to first discard unsent output.
    """
    lines = {line for line, _ in last_words}
    for line in lines if drop else ():
        drop_what_waits(line)
    for _ in range(TIMES):
        for line, data in last_words:
            try:
                if line in lines:
                    os.write(line, data)
            except BlockingIOError:
                drop_what_waits(line)
            except OSError as error:
                if error.errno in GONE:
                    lines.discard(line)  # after other errors, the next datagram may arrive
        if not lines or select.select(until, [], [], PACE_S)[0]:
            return


def drop_what_waits(line: int) -> None:
    """Discard the output that the line has not sent yet, which may contain motion commands."""
    # contextlib would take a tenth of the guard's memory
    try:  # noqa: SIM105
        termios.tcflush(line, termios.TCOFLUSH)
    except termios.error:
        pass  # a socket, or a lost line


def words(argument: str) -> Words:
    """Return the packets in a text of the form ``DESCRIPTOR:HEX,DESCRIPTOR:HEX``."""
    each = (word.split(":") for word in argument.split(",") if word)
    return [(int(descriptor), bytes.fromhex(data)) for descriptor, data in each]


if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)  # these signals end the driver, not its guard
    watch(words(sys.argv[1]), words(sys.argv[2]))
