# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command line of the monitor: ``ros2 run omnibot_driver monitor``."""

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from omnibot_driver.ros_arguments import split_ros_arguments
from omnibot_driver.tools.drivers import discovery_advice
from omnibot_driver.tools.monitor import text
from omnibot_driver.tools.monitor.model import View
from omnibot_driver.tools.monitor.rates import WINDOW_S
from omnibot_driver.tools.monitor.screen import has_screen
from omnibot_driver.tools.monitor.teleop import DeadMan
from omnibot_driver.tools.needs import ToolError, need
from omnibot_driver.tools.printing import discard_output, printing, replace_unprintable

if TYPE_CHECKING:
    from omnibot_driver.tools.monitor.feed import Feed

LOOK_EVERY_S: Final = 0.05


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the monitor; return 0, or 1 after an error on stderr. Exit with code 2 on wrong usage."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options, ros_arguments = _parse(arguments)
    replace_unprintable()
    try:
        return _run(options, ros_arguments)
    except ToolError as error:
        print(f"monitor: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("monitor: interrupted", file=sys.stderr)
    except BrokenPipeError:  # the pipe's reader has ended
        discard_output()
    return 1


def _parse(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    parser = argparse.ArgumentParser(
        prog="monitor",
        description="Show a running driver on one screen; the space bar latches the e-stop.",
        epilog="ROS's own arguments follow --ros-args. Exit codes: 0 at the end, 1 with a message"
        " when something is missing or wrong, 2 on wrong usage. See docs/tools/monitor.md.",
    )
    parser.add_argument(
        "--namespace", default="", metavar="NAME", help="namespace of the driver, such as /robot1"
    )
    parser.add_argument(
        "--driver",
        default="omnibot_driver",
        metavar="NAME",
        help="the driver's node name (default: %(default)s)",
    )
    parser.add_argument("--once", action="store_true", help="print one snapshot and end")
    parser.add_argument("--json", action="store_true", help="print one snapshot as JSON and end")
    parser.add_argument(
        "--teleop",
        action="store_true",
        help="steer with the keys WASD or the arrows; J and L turn the robot, + and - change the"
        " speed",
    )
    parser.add_argument(
        "--timeout",
        type=float,
        default=10.0,
        metavar="S",
        help="wait this many seconds for the driver; inf waits for ever (default: %(default)g)",
    )
    ours, ros = split_ros_arguments(arguments)
    options = parser.parse_args(ours)
    options.once |= options.json
    if not options.timeout > 0.0:
        parser.error("--timeout must be a number above 0")
    if options.once and options.teleop:
        parser.error("--teleop needs the screen: omit --once and --json")
    return options, ros


def _run(options: argparse.Namespace, ros_arguments: list[str]) -> int:
    if not options.once and not has_screen():
        if options.teleop:
            raise ToolError("--teleop needs a terminal: a pipe has no keys")
        print(
            "monitor: this is not a terminal, so one snapshot is printed, as with --once",
            file=sys.stderr,
        )
        options.once = True
    if not options.once:
        need("textual")
    try:
        from omnibot_driver.tools.monitor.feed import Feed
    except ImportError as error:
        raise ToolError(
            f"this program needs ROS 2 Jazzy's Python packages ({error}): source its setup.bash"
        ) from error
    dead_man = DeadMan() if options.teleop else None
    feed = Feed(ros_arguments, options.namespace, options.driver, dead_man)
    try:
        _find(feed, options.timeout)
        if options.once:
            return _print(_gather(feed, options.timeout), feed, options.json)
        feed.say(feed.namesakes())
        from omnibot_driver.tools.monitor.app import Monitor

        screen = Monitor(feed)
        screen.run()
        return screen.return_code or 0
    finally:
        feed.close()


def _find(feed: "Feed", timeout_s: float) -> None:
    """Wait until the driver publishes its state.

    Raises ToolError if no state arrives within ``timeout_s``. The message names other running
    drivers.
    """
    if _comes_about(lambda: bool(feed.view().state), timeout_s):
        return
    there = feed.drivers()
    if feed.driver in there:
        raise ToolError(
            f"{feed.driver} exists, but has sent nothing for {timeout_s:g} s; check that it runs"
            " and that its computer can be reached"
        )
    if not there:
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        raise ToolError(
            f"no driver is running in ROS domain {domain}: start one with ros2 run omnibot_driver"
            f" driver, or set ROS_DOMAIN_ID to the driver's domain{discovery_advice()}"
        )
    namespace, _, name = there[0].rpartition("/")
    others = f"--namespace {namespace or '/'}" + (
        f" --driver {name}" if name != feed.driver.rpartition("/")[2] else ""
    )
    raise ToolError(
        f"no driver {feed.driver} is running, but these drivers are: {', '.join(there)}; try"
        f" {others}"
    )


def _gather(feed: "Feed", timeout_s: float) -> View:
    """Wait for a message on each expected topic, at most ``timeout_s``; return the view.

    The call takes at least 2 s (``WINDOW_S``), in which the message rates are measured.
    """
    began_s = time.monotonic()
    _comes_about(lambda: not feed.view().missing(feed.diagnoses()), timeout_s)
    _comes_about(lambda: time.monotonic() - began_s > WINDOW_S, WINDOW_S)
    view: View = feed.view()
    return view


def _print(view: View, feed: "Feed", as_json: bool) -> int:
    troubles = [namesakes] if (namesakes := feed.namesakes()) else []
    if missing := view.missing(feed.diagnoses()):
        troubles.append(
            f"{view.driver} is {view.state}, but no messages arrive on {', '.join(missing)}; check"
            " remappings and the network"
        )
    if strange := view.not_finite():
        troubles.append(
            f"these values are NaN or infinite: {', '.join(strange)}; before you drive, fix the"
            " node that publishes such values"
        )
    with printing():
        print(
            text.as_json(view, troubles) if as_json else text.report(view),
            end="\n" if as_json else "",
            flush=True,
        )
    for trouble in troubles:
        print(f"monitor: {trouble}", file=sys.stderr)
    return 1 if troubles else 0


def _comes_about(predicate: Callable[[], bool], timeout_s: float) -> bool:
    deadline_s = time.monotonic() + timeout_s
    while not (holds := predicate()) and time.monotonic() < deadline_s:
        time.sleep(LOOK_EVERY_S)
    return holds


if __name__ == "__main__":
    sys.exit(main())
