# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver process: it starts the node, waits for a reason to end, and returns an exit code.

This module knows signals and the executor; it does not know what the node does.
"""

import contextlib
import os
import re
import select
import signal
import sys
import threading
import time
import warnings
from typing import Final

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.output import UnblockedOutput, fill_gaps
from omnibot_driver.ros_arguments import split_ros_arguments

STOPPED_BY: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
LONGEST_END_S: Final = 5.0
"""Longest time from the event that ends the driver to the end of the process, in s."""
LARGEST_DOMAIN: Final = 232
"""Largest ROS_DOMAIN_ID of Fast DDS. A larger one would require UDP ports above 65535."""
USAGE: Final = (
    "give parameters like this: --ros-args -p port:=/dev/ttyUSB0; names like this:"
    " --ros-args -r __ns:=/robot1"
)
HELP: Final = """\
usage: ros2 run omnibot_driver driver [--ros-args -p NAME:=VALUE ... --params-file FILE]

The driver of a robot's motor board: publishes its measurements, and sends it your commands.

Give parameters like this: --ros-args -p port:=/dev/ttyUSB0
Give names like this: --ros-args -r __ns:=/robot1
Without a robot: --ros-args -p port:=sim://
The parameter `board` says which board it is (default: omnibot). config/<board>.yaml has every
parameter of that board with its default and its permitted values; docs/parameters.md has those
of all boards. README.md has the topics and services."""
SETUP: Final = (
    "ROS 2 is not set up in this shell, or a library is not installed: `source"
    " /opt/ros/jazzy/setup.bash`, then `rosdep install --from-paths src`"
)

HINTS: Final = {
    "parameter override rule": "write -p NAME:=VALUE, and quote an empty text: -p \"NAME:=''\"",
    "remap rule": "write -r NAME:=VALUE, such as -r __ns:=/robot1",
    "params file": "check that the file exists and is valid YAML",
}
"""Advice about an argument that ROS rejects. The keys are words in the error text of ROS."""


class Ending:
    """The event that ends the driver: a signal, or a call of ``begin``.

    Signals write to a pipe, because signal handlers must not use locks. ``defect``: the exception
    that ended the driver, or None.
    """

    def __init__(self) -> None:
        self.defect: BaseException | None = None
        self._wakes, self._wake = os.pipe()
        os.set_blocking(self._wake, False)
        signal.set_wakeup_fd(self._wake, warn_on_full_buffer=False)
        for number in STOPPED_BY:
            # A driver that was started with nohup must still ignore SIGHUP.
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, lambda *_: None)

    def begin(self, defect: BaseException | None = None) -> None:
        """Begin to end the driver. Any thread may call this.

        ``defect``: the exception that ends the driver, if any. With a defect the exit code is 1.
        """
        self.defect = self.defect or defect
        os.write(self._wake, b"\0")

    @property
    def begun(self) -> bool:
        """Whether the driver must end: a signal came, or ``begin`` was called."""
        return bool(select.select([self._wakes], [], [], 0)[0])

    def wait(self) -> None:
        """Wait for a signal or a call of ``begin``."""
        os.read(self._wakes, 1)


def main(args: list[str] | None = None) -> int:
    """Run the driver until it must end, and return the exit code.

    The exit code is 0 after a normal end, 1 after a defect, and 2 if the driver cannot start.
    """
    args = sys.argv if args is None else args
    fill_gaps()
    if {"-h", "--help"}.intersection(args[1:]):
        with UnblockedOutput():
            print(HELP)
        return 0
    # The import takes half a second. ``ending`` is created first, so that a signal during the
    # import ends the driver. If RMW_IMPLEMENTATION is wrong, ROS prints an error and ends the
    # process during the import. UnblockedOutput begins after the import, because its pipe would
    # lose this error text.
    ending = Ending()
    with contextlib.suppress(ImportError):
        import rclpy._rclpy_pybind11  # noqa: F401
    with UnblockedOutput():
        try:
            return _main(ending, args)
        except ModuleNotFoundError as error:
            return _refuse(f"{error}; {SETUP}")


def _refuse(why: str) -> int:
    print(f"omnibot_driver cannot start: {why}", file=sys.stderr)
    return 2


def in_plain_words(text: str) -> str:
    """Return an error text of ROS without positions in the source code of ROS, and add advice."""
    text = re.sub(r", at \S+:\d+", "", text).removeprefix("Failed to parse ROS arguments: ")
    text = re.sub(r"\. Error: (error not set|Unknown YAML event|.*lexeme.*)$", "", text)
    return "; ".join([text, *(hint for words, hint in HINTS.items() if words in text)])


def too_large(domain: str) -> bool:
    """Return whether the number of this ROS domain is too large for Fast DDS.

    With such a number, Fast DDS would silently end the process.
    """
    return domain.isdecimal() and int(domain) > LARGEST_DOMAIN


def _main(ending: Ending, args: list[str]) -> int:
    import rclpy
    from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
    from rclpy.exceptions import NameValidationException, ParameterException
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import get_rmw_implementation_identifier

    domain = os.environ.get("ROS_DOMAIN_ID", "")
    if get_rmw_implementation_identifier().startswith("rmw_fastrtps") and too_large(domain):
        return _refuse(f"ROS_DOMAIN_ID is {domain}; Fast DDS allows at most {LARGEST_DOMAIN}")
    try:
        # ROS itself would take ``port:=/dev/x`` for a topic's new name in the deprecated form.
        if unknown := split_ros_arguments(args[1:])[0]:
            return _refuse(f"unknown argument {' '.join(unknown)}; {USAGE}")
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        rclpy.get_default_context().on_shutdown(ending.begin)
        _run(ending, args)
    except UnknownROSArgsError as error:  # its text is a Python list
        words = str(error)[1:-1].replace("', '", " ").strip("'")
        return _refuse(f"unknown argument {words}; {USAGE}")
    except NameValidationException as error:  # its second line is the name, which may be long
        why = str(error).partition(":\n")[0]
        return _refuse(f"{why}; give another namespace or name: --ros-args -r __ns:=/robot1")
    except RCLError as error:
        return _refuse(in_plain_words(str(error)))
    except (ParameterError, ParameterException) as error:
        return _refuse(str(error))
    finally:
        rclpy.try_shutdown()
        for number in STOPPED_BY:  # while Python ends, a late ctrl-C would kill it
            signal.signal(number, signal.SIG_IGN)
    return 0 if ending.defect is None else 1


def _run(ending: Ending, args: list[str]) -> None:
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from omnibot_driver import selfcheck
    from omnibot_driver.node import OmniBotDriver

    if ending.begun:
        return
    # rclpy's warning that an answer of a service was lost: report each one, not only the first
    warnings.filterwarnings("always", "failed to send response", RuntimeWarning)
    driver = OmniBotDriver(end=ending.begin)
    for advice in selfcheck.unread_files(args, driver.get_fully_qualified_name()):
        driver.get_logger().warning(advice)
    executor = SingleThreadedExecutor()
    executor.add_node(driver)
    stopping = threading.Event()

    def spin() -> None:
        try:
            while not stopping.is_set():
                executor.spin_once()
        except ExternalShutdownException:
            ending.begin()
        except BaseException as error:  # SystemExit too: without the executor no callback would run
            driver.report_defect(error)

    # The executor runs in its own thread, so that the driver reacts to a signal even if a callback
    # takes long, and a second signal cannot interrupt the shutdown.
    spinner = threading.Thread(target=spin, name="omnibot-executor", daemon=True)
    spinner.start()
    ending.wait()
    _set_deadline()
    driver.close()
    # The executor runs its newest task first. The services that waited for the board now have a
    # result. They run after the outer task and before the inner one, so they still answer.
    executor.create_task(lambda: executor.create_task(stopping.set))
    spinner.join(timeout=0.5)
    stopping.set()  # for a callback that hangs and returns later
    if not spinner.is_alive():
        executor.shutdown(timeout_sec=0.0)  # otherwise rclpy may print a traceback at exit
    driver.destroy_node()


def _set_deadline() -> None:
    """End the process by force if the shutdown takes longer than 5 s (``LONGEST_END_S``).

    The guard process then stops the robot.
    """

    def give_up() -> None:
        try:
            text = "omnibot_driver hung during shutdown and is terminated"
            print(text, file=sys.stderr, flush=True)
            time.sleep(0.1)  # until the text is copied
        finally:  # also when no program reads the output
            os._exit(1)

    deadline = threading.Timer(LONGEST_END_S, give_up)
    deadline.daemon = True
    # If no thread can be started, the shutdown goes on: it must still stop the robot.
    with contextlib.suppress(RuntimeError):
        deadline.start()


if __name__ == "__main__":
    sys.exit(main())
