# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The guard: a process of its own that stops the robot when the driver no longer can.

It shares the driver's open lines, serial ports or connected sockets, and hears a heartbeat on its
standard input. When the heartbeat ceases, or the driver is gone, it repeats the stop that it was
given, for a second or until the driver is heard again: the emergency stop if the last heartbeat
said that it is latched. It knows no board, and imports next to nothing, so that it is small and
soon there: `keeper.py` starts it as ``python guard.py STOP EMERGENCY_STOP``. Each is what to write,
one thing after the other, as ``DESCRIPTOR:HEX,DESCRIPTOR:HEX``. Where they change, the driver says
so between two heartbeats, as ``=STOP EMERGENCY_STOP`` and a new line.
"""

import _signal as signal  # type: ignore[import-not-found]  # ``signal`` itself brings ``enum``
import errno
import os
import select
import sys
import termios

BEAT = b"."
LATCHED_BEAT = b"e"
"""The driver is alive and its e-stop is latched."""
WORDS = b"="
END = b"\n"
"""Other words from now on stand between them."""
BYE = b"!"
"""The driver has stopped the robot itself; the guard may leave."""
LIMIT_S = 0.5
"""After this time without a heartbeat the driver is taken to hang."""
TIMES = 20
PACE_S = 0.05

GONE = (errno.EBADF, errno.EIO, errno.ENODEV, errno.ENXIO, errno.EPIPE)
"""Errors of a line that no longer accepts data."""

DRIVER = 0


Words = list[tuple[int, bytes]]
"""Descriptors, and what is written to them."""


def watch(stop: Words, emergency_stop: Words) -> None:
    """Watch the driver until it has gone, and a second longer unless it announced its end."""
    patience_s: float | None = LIMIT_S
    latched, rest = False, b""
    while True:
        for line, _ in stop + emergency_stop:
            os.set_blocking(line, False)
        last_words = emergency_stop if latched else stop
        if not select.select([DRIVER], [], [], patience_s)[0]:
            speak(last_words, until=[DRIVER])
            patience_s = None
        elif not (heard := os.read(DRIVER, 4096)):
            speak(last_words, until=[])
            return
        else:
            patience_s = LIMIT_S
            beats, given, rest = parted(rest + heard)
            if BYE in beats:
                return
            if given:
                stop, emergency_stop = map(words, given.decode().split(" "))
            if beats:
                latched = beats.endswith(LATCHED_BEAT)


def parted(heard: bytes) -> tuple[bytes, bytes, bytes]:
    """Beats, the newest words that are whole, and the beginning of others."""
    beats = given = b""
    while WORDS in heard:
        before, _, after = heard.partition(WORDS)
        beats += before
        whole, end, heard = after.partition(END)
        if not end:
            return beats, given, WORDS + after
        given = whole
    return beats + heard, given, b""


def speak(last_words: Words, until: list[int]) -> None:
    """Say them ``TIMES`` times; stop when there is something to read from one of ``until``."""
    lines = {line for line, _ in last_words}
    for line in lines:
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
                    lines.discard(line)  # else a datagram was lost; the next one may be heard
        if not lines or select.select(until, [], [], PACE_S)[0]:
            return


def drop_what_waits(line: int) -> None:
    """Motion commands that are still on their way must not keep the stop waiting."""
    # contextlib would take a tenth of the guard's memory
    try:  # noqa: SIM105
        termios.tcflush(line, termios.TCOFLUSH)
    except termios.error:
        pass  # a socket, or gone


def words(argument: str) -> Words:
    """Split the argument that `keeper.py` made of the last words."""
    each = (word.split(":") for word in argument.split(",") if word)
    return [(int(descriptor), bytes.fromhex(data)) for descriptor, data in each]


if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)  # these signals end the driver, not its guard
    watch(words(sys.argv[1]), words(sys.argv[2]))
