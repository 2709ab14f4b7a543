# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command line of the simulated board: real time, a pseudo-terminal, a small console on stdin.

Knows arguments, signals and the console. Must not know the wire or the board's insides.
"""

import argparse
import json
import os
import select
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict

from omnibot_driver.simulator.common.pty import PtyBoard
from omnibot_driver.simulator.omnibot.options import add_board_options, board_from

_CONSOLE_HELP = """\
truth    one line of JSON: true pose and twist, the board's odometry, mode
reboot   power-cycle the board; the robot stays where it is
help     this list
quit     end (so do ctrl-C and SIGTERM; the end of the input does not)"""

_HEALTH_CHECK_S = 0.5


def main(argv: list[str] | None = None) -> int:
    """Run a simulated board until told to end; return the exit code."""
    arguments = _parser().parse_args(argv)
    board, line = board_from(arguments)
    try:
        with _signals_as_readable() as signalled, PtyBoard(board, arguments.link, line) as port:
            print(port.path, flush=True)
            print(
                f"A simulated OmniBot board listens on {arguments.link or port.path}. In another "
                "terminal:\n"
                "  ros2 run omnibot_driver driver --ros-args "
                f"-p port:={arguments.link or port.path}\n"
                "Type help for the commands here; ctrl-C ends it.",
                file=sys.stderr,
            )
            _serve(port, signalled)
    except OSError as error:
        print(f"simulator: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="simulator",
        description="A simulated OmniBot board on a pseudo-terminal; prints the terminal's path.",
        epilog="Commands on standard input:\n" + _CONSOLE_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--link", metavar="PATH", help="make a symbolic link to the terminal")
    add_board_options(parser)
    return parser


@contextmanager
def _signals_as_readable() -> Iterator[int]:
    """Yield a descriptor that becomes readable on SIGINT or SIGTERM, which then do nothing else."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    old_writer = signal.set_wakeup_fd(writer)
    ending = (signal.SIGINT, signal.SIGTERM)
    old_handlers = [signal.signal(number, lambda *_: None) for number in ending]
    try:
        yield reader
    finally:
        for number, handler in zip(ending, old_handlers, strict=True):
            signal.signal(number, handler)
        signal.set_wakeup_fd(old_writer)
        os.close(reader)
        os.close(writer)


def _serve(port: PtyBoard, signalled: int) -> None:
    """Answer the console until a signal or `quit`."""
    console = sys.stdin.fileno() if sys.stdin else None
    held = b""
    while True:
        watched = [signalled] if console is None else [signalled, console]
        readable, _, _ = select.select(watched, [], [], _HEALTH_CHECK_S)
        port.check()
        if signalled in readable:
            return
        if console in readable:
            data = os.read(console, 4096)
            if not data:
                console = None
            *lines, held = (held + data).split(b"\n")
            for line in lines:
                if not _answer(line.decode(errors="replace").strip(), port):
                    return


def _answer(command: str, port: PtyBoard) -> bool:
    """Do one console command; False ends the program."""
    if command == "truth":
        print(json.dumps(_truth(port)), flush=True)
    elif command == "reboot":
        with port.lock:
            port.board.reboot()
    elif command == "help":
        print(_CONSOLE_HELP, file=sys.stderr)
    elif command == "quit":
        return False
    elif command:
        print(f"simulator: no command {command!r}; help lists them", file=sys.stderr)
    return True


def _truth(port: PtyBoard) -> dict[str, object]:
    with port.lock:
        board = port.board
        return {
            **asdict(board.truth),
            "mode": board.mode.value,
            "estopped": board.estopped,
            "odometry": asdict(board.odometry),
            "tick": board.tick,
            "dropped": port.dropped,
            "lost": port.line.lost,
            "flipped": port.line.flipped,
        }


if __name__ == "__main__":
    sys.exit(main())
