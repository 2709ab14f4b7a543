# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command line that runs a simulated board in real time, with its ports and a console on stdin.

This module must not know any board's protocol or internals.
"""

import argparse
import json
import os
import pkgutil
import select
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from omnibot_driver import simulator
from omnibot_driver.simulator.common import options
from omnibot_driver.simulator.common.board import SimulatedBoard, SimulatorModule
from omnibot_driver.simulator.common.serving import ServedBoard

_CONSOLE_HELP = """\
truth    print the true pose and the true state of the robot as one line of JSON
reboot   power-cycle the board; the robot stays where it is
help     print this list
quit     end the simulator; ctrl-C, SIGTERM and a closed terminal also end the simulator, but the
         end of the input does not"""

_HEALTH_CHECK_S = 0.5


def main(argv: Sequence[str] | None = None) -> int:
    """Run a simulated board until a signal or ``quit``; return the exit code."""
    chooser = argparse.ArgumentParser(prog="simulator", add_help=False, allow_abbrev=False)
    _add_board(chooser)
    name = chooser.parse_known_args(argv)[0].board
    if name not in boards():
        known = ", ".join(boards())
        print(f"simulator: there is no simulated board {name!r}: choose {known}", file=sys.stderr)
        return 2
    return run(options.load(f"{simulator.__name__}.{name}"), name, argv)


def boards() -> list[str]:
    """Return the names of the simulated boards: all packages in this folder except ``common``."""
    return [
        module.name
        for module in pkgutil.iter_modules(simulator.__path__)
        if module.ispkg and module.name != "common"
    ]


def run(module: SimulatorModule, name: str, argv: Sequence[str] | None) -> int:
    """Run the board of ``module`` until a signal or ``quit``; return the exit code."""
    arguments = _parser(module).parse_args(argv)
    board, lines = options.from_arguments(arguments, module)
    # The printed command needs absolute paths: the driver refuses others, and the user may run the
    # command in another folder.
    links = [os.path.abspath(link) for link in getattr(arguments, "link", None) or []]
    try:
        with (
            _signals_as_readable() as signalled,
            ServedBoard(
                board, lines, links=links, udp_port=getattr(arguments, "udp_port", 0)
            ) as served,
        ):
            print(*served.addresses, sep="\n", flush=True)
            print(_hints(module, name, served), file=sys.stderr)
            _serve(served, signalled)
    except OSError as error:
        print(f"simulator: {error}", file=sys.stderr)
        return 1
    return 0


def _add_board(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--board",
        default=options.DEFAULT_BOARD,
        metavar="NAME",
        help=f"the board to simulate: {', '.join(boards())} (default {options.DEFAULT_BOARD});"
        " --board NAME --help lists the options of a board",
    )


def _parser(module: SimulatorModule) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="simulator",
        description=f"A simulated {module.TITLE} board.\nPrints the address of each port on a line"
        " of its own: the path of a\npseudo-terminal, or udp://127.0.0.1:PORT.",
        epilog="Commands on standard input:\n" + _CONSOLE_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_board(parser)
    if any(not channel.datagrams for channel in module.CHANNELS):
        parser.add_argument(
            "--link",
            metavar="PATH",
            action="append",
            help="make a symbolic link at PATH to the board's pseudo-terminal. If the board has"
            " several, give one --link for each, in the order of the printed addresses. If you give"
            " only one, each link is PATH-NAME, where NAME is the name of the port",
        )
    if any(channel.datagrams for channel in module.CHANNELS):
        parser.add_argument(
            "--udp-port",
            type=int,
            default=0,
            metavar="NUMBER",
            help="number of the first UDP port; further ports have the numbers after it (default:"
            " any free ports)",
        )
    options.add_options(parser, module)
    return parser


def _hints(module: SimulatorModule, name: str, served: ServedBoard[SimulatedBoard]) -> str:
    places = list(zip(module.CHANNELS, served.names, strict=True))
    board = "" if name == options.DEFAULT_BOARD else f"-p board:={name} "
    ports = " ".join(f"-p {c.parameter}:={place}" for c, place in places if c.parameter)
    return (
        f"A simulated {module.TITLE} board listens on {', '.join(place for _, place in places)}. "
        "In another terminal:\n"
        f"  ros2 run omnibot_driver driver --ros-args {board}{ports}\n"
        "Type help for the commands here; ctrl-C ends the simulator."
    )


@contextmanager
def _signals_as_readable() -> Iterator[int]:
    """Yield a descriptor that becomes readable when SIGINT, SIGTERM or SIGHUP arrives.

    The signals have no other effect. SIGHUP stays ignored under nohup.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    old_writer = signal.set_wakeup_fd(writer)
    ending = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        ending.append(signal.SIGHUP)
    old_handlers = [signal.signal(number, lambda *_: None) for number in ending]
    try:
        yield reader
    finally:
        for number, handler in zip(ending, old_handlers, strict=True):
            signal.signal(number, handler)
        signal.set_wakeup_fd(old_writer)
        os.close(reader)
        os.close(writer)


def _serve(served: ServedBoard[SimulatedBoard], signalled: int) -> None:
    """Execute console commands until a signal arrives or ``quit`` is entered."""
    console = sys.stdin.fileno() if sys.stdin else None
    held = b""
    while True:
        watched = [signalled]
        if console is not None and not _is_in_background(console):
            watched.append(console)
        readable, _, _ = select.select(watched, [], [], _HEALTH_CHECK_S)
        served.check()
        if signalled in readable:
            return
        if console in readable:
            data = _typed(console)
            if not data:
                console = None
            *lines, held = (held + data).split(b"\n")
            for line in lines:
                if not _answer(line.decode(errors="replace").strip(), served):
                    return


def _is_in_background(console: int) -> bool:
    """Return whether the console is a terminal that now belongs to another program.

    The kernel would suspend this process if it read from such a terminal.
    """
    try:
        return os.tcgetpgrp(console) != os.getpgrp()
    except OSError:  # the console is not this process's terminal
        return False


def _typed(console: int) -> bytes:
    """Return the next input of the console; empty at its end, or if the terminal was closed."""
    try:
        return os.read(console, 4096)
    except OSError:
        return b""


def _answer(command: str, served: ServedBoard[SimulatedBoard]) -> bool:
    """Execute one console command; return False if the command ends the program."""
    if command == "truth":
        with served.lock:
            facts = served.facts
        print(json.dumps(facts), flush=True)
    elif command == "reboot":
        with served.lock:
            served.board.reboot()
    elif command == "help":
        print(_CONSOLE_HELP, file=sys.stderr)
    elif command == "quit":
        return False
    elif command:
        print(f"simulator: no command {command!r}; help lists the commands", file=sys.stderr)
    return True


if __name__ == "__main__":
    sys.exit(main())
