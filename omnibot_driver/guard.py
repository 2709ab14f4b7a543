# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The guard: a process of its own that stops the robot when the driver no longer can.

It shares the driver's open port, and hears a heartbeat on its standard input. When the heartbeat
ceases, or the driver is gone, it repeats the stop that it was given, for a second or until the
driver is heard again: the emergency stop if the last heartbeat said that it is latched. It knows no
board, and imports next to nothing, so that it is small and soon there: `keeper.py` starts it as
``python guard.py PORT_DESCRIPTOR STOP_IN_HEX EMERGENCY_STOP_IN_HEX``.
"""

import contextlib
import os
import select
import signal
import sys
import termios

BEAT = b"."
LATCHED_BEAT = b"e"
"""The driver is alive and its e-stop is latched."""
BYE = b"!"
"""The driver has stopped the robot itself; the guard may leave."""
LIMIT_S = 0.5
"""Without a heartbeat for so long the driver hangs."""
TIMES = 20
PACE_S = 0.05

DRIVER = 0


def watch(port: int, stop: bytes, emergency_stop: bytes) -> None:
    """Until the driver is gone, and then a second longer unless it said that it goes."""
    os.set_blocking(port, False)
    patience_s: float | None = LIMIT_S
    last_words = stop
    while True:
        if not select.select([DRIVER], [], [], patience_s)[0]:
            speak(port, last_words, until=[DRIVER])
            patience_s = None
        elif not (heard := os.read(DRIVER, 4096)):
            speak(port, last_words, until=[])
            return
        elif BYE in heard:
            return
        else:
            patience_s = LIMIT_S
            last_words = emergency_stop if heard.endswith(LATCHED_BEAT) else stop


def speak(port: int, last_words: bytes, until: list[int]) -> None:
    """Say them ``TIMES`` times; stop when there is something to read from one of ``until``."""
    drop_what_waits(port)
    for _ in range(TIMES):
        try:
            os.write(port, last_words)
        except BlockingIOError:
            drop_what_waits(port)
        except OSError:
            return  # gone
        if select.select(until, [], [], PACE_S)[0]:
            return


def drop_what_waits(port: int) -> None:
    """Motion commands that are still on their way must not keep the stop waiting."""
    with contextlib.suppress(termios.error):  # a socket, or gone
        termios.tcflush(port, termios.TCOFLUSH)


if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)  # whoever ends the driver so need not ask its guard
    watch(int(sys.argv[1]), bytes.fromhex(sys.argv[2]), bytes.fromhex(sys.argv[3]))
