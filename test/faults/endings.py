# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Ways in which a driver ends while the robot drives: on request, by a defect, or by force.

After an ending, the rig has no driver.
"""

import os
import pty
import signal
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from rig import Rig
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

IN_A_CALLBACK: Final = """
import ctypes, os, sys, time, rclpy
import omnibot_driver.node as node
def end(self, message):
    {}
node.OmniBotDriver._on_estop_topic = end
"""
IN_THE_READER: Final = """
import omnibot_driver.node as node
from omnibot_driver.core.inbound import Inbound
def end(self, message):
    def hear(self, data, now, channel):
        raise ZeroDivisionError("a defect in the reader")
    Inbound.hear = hear
node.OmniBotDriver._on_estop_topic = end
"""
HANGS: Final = """
import time
from omnibot_driver.core.shutdown import Shutdown
Shutdown.sequence = lambda self, on_exit, now: time.sleep(60.0)
"""
GROUP: Final = "import os; os.setpgid(0, 0)"
TERMINAL: Final = """
import fcntl, os, termios
os.setsid()
terminal = os.open({!r}, os.O_RDWR)
fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
for number in (0, 1, 2):
    os.dup2(terminal, number)
os.close(terminal)
"""


@dataclass(frozen=True)
class Ending:
    """A way to end the driver, and the result that is expected. The board must receive Stop last.

    ``before``: Python code that runs in the driver's process before the driver starts.

    ``allowed_s``: how long the robot may still drive, in s.

    ``late_s``: additional time within which the driver's process must end, in s.

    ``full``: whether the driver's port is full of old commands.

    ``read``: whether the driver ends only at its next read of data.

    With ``full`` or ``read``, the robot may drive longer.
    """

    end: Callable[[Rig], object]
    exit_codes: tuple[int, ...] = (0,)
    before: str = ""
    allowed_s: float = 0.0
    late_s: float = 0.0
    full: bool = False
    read: bool = False

    def __call__(self, rig: Rig) -> None:
        """End the driver while the robot drives, and check the result.

        The exit code must be right, the robot must stop, and the board must have received Stop
        last.
        """
        rig.drive()
        self.end(rig)
        since = rig.line.tick
        rig.expect_ended(*self.exit_codes, late_s=self.late_s)
        more_s = self.full * rig.kind.old_bytes_s + self.read * rig.kind.silent_s
        rig.expect_still(since, "the driver ends", self.allowed_s + more_s)
        rig.hand.leave()
        heard = bytes(rig.line.board.received)
        rig.findings.expect(heard.endswith(rig.kind.stop), f"last received: {heard[-26:].hex(' ')}")


def by_signals(*numbers: signal.Signals) -> Callable[[Rig], None]:
    """Return a function that sends these signals to the driver, one after the other."""

    def end(rig: Rig) -> None:
        for number in numbers:
            rig.driver.process.send_signal(number)

    return end


def by_signals_to_its_group(*numbers: signal.Signals) -> Callable[[Rig], None]:
    """Return a function that signals the driver's process group, as a shell or a launcher does.

    The signals follow each other without pauses.
    """

    def end(rig: Rig) -> None:
        for number in numbers:
            os.killpg(rig.driver.process.pid, number)

    return end


def by_topic(rig: Rig) -> None:
    """End the driver by a message on the topic ``estop``.

    ``Ending.before`` has replaced the callback of this topic by one that ends the driver.
    """
    publisher = rig.probe.publisher(Bool, "estop")
    publisher.publish(Bool(data=True))


def by_signal_while_a_call_is_pending(rig: Rig) -> None:
    """Send SIGTERM while a call of ``~/reset`` is pending."""
    mark = len(rig.driver.lines)
    rig.probe.call_async(Trigger, "reset")
    rig.driver.wait_for_line("state: connecting", mark)
    rig.driver.process.send_signal(signal.SIGTERM)


def by_signal_before_a_lost_port_is_open_again(rig: Rig) -> None:
    """Plug in the cable again, and send SIGINT to the driver before it has opened the port.

    At this time, the robot still carries out its last command, so the driver must stop the robot.
    """
    rig.unplug()
    rig.probe.wait_for_state("disconnected")
    rig.plug()
    rig.driver.process.send_signal(signal.SIGINT)


def while_full(end: Callable[[Rig], object], rig: Rig) -> None:
    """Run ``end`` while the driver's port accepts no data, and wait until the driver has ended."""
    with rig.terminal.full(rig.kind.old_command):
        end(rig)
        rig.driver.process.wait()


ENDINGS: Final[dict[str, Ending]] = {
    "ctrl-C": Ending(by_signals(signal.SIGINT)),
    "ctrl-C twice": Ending(by_signals(signal.SIGINT, signal.SIGINT)),
    "SIGTERM": Ending(by_signals(signal.SIGTERM)),
    "SIGHUP": Ending(by_signals(signal.SIGHUP)),
    "SIGQUIT": Ending(by_signals(signal.SIGQUIT)),
    "ctrl-C, plugged in but not yet open again": Ending(
        by_signal_before_a_lost_port_is_open_again, allowed_s=0.2
    ),
    "SIGTERM while a call is pending": Ending(by_signal_while_a_call_is_pending),
    "SIGINT and SIGTERM to its process group": Ending(
        by_signals_to_its_group(signal.SIGINT, signal.SIGTERM), before=GROUP
    ),
    "SIGINT, SIGTERM, SIGKILL to its process group": Ending(
        by_signals_to_its_group(signal.SIGINT, signal.SIGTERM, signal.SIGKILL),
        (0, -signal.SIGKILL),
        GROUP,
    ),
    "a shutdown of ROS": Ending(by_topic, before=IN_A_CALLBACK.format("rclpy.shutdown()")),
    "an exception in a callback": Ending(by_topic, (1,), before=IN_A_CALLBACK.format("1 / 0")),
    "an exit in a callback": Ending(by_topic, (1,), before=IN_A_CALLBACK.format("sys.exit(5)")),
    "a callback that hangs, and ctrl-C": Ending(
        lambda rig: (by_topic(rig), rig.wait_ticks(20), by_signals(signal.SIGINT)(rig)),
        before=IN_A_CALLBACK.format("time.sleep(60.0)"),
    ),
    "a final Stop that hangs, and ctrl-C": Ending(
        by_signals(signal.SIGINT), (1,), HANGS, allowed_s=0.5, late_s=4.0
    ),
    "an exception in the reader": Ending(by_topic, (1,), before=IN_THE_READER, read=True),
    "SIGINT while the port is full": Ending(
        partial(while_full, by_signals(signal.SIGINT)), full=True
    ),
    "an exception while the port is full": Ending(
        partial(while_full, by_topic),
        (1,),
        IN_A_CALLBACK.format("1 / 0"),
        full=True,
    ),
    "SIGKILL": Ending(by_signals(signal.SIGKILL), (-signal.SIGKILL,)),
    "SIGKILL while the port is full": Ending(
        partial(while_full, by_signals(signal.SIGKILL)), (-signal.SIGKILL,), full=True
    ),
    "a segmentation fault": Ending(
        by_topic, (-signal.SIGSEGV,), IN_A_CALLBACK.format("ctypes.string_at(0)")
    ),
    "a library that exits": Ending(by_topic, (3,), IN_A_CALLBACK.format("os._exit(3)")),
}


def terminal_is_closed(
    make_rig: Callable[[str], Rig], run: Callable[[Rig, Ending], object]
) -> None:
    """Close the driver's terminal, as when an ssh session ends.

    The driver gets SIGHUP, and its output is no longer read.
    """
    master, slave = pty.openpty()
    with make_rig(TERMINAL.format(os.ttyname(slave))) as rig:
        os.close(slave)
        run(rig, Ending(lambda _: os.close(master)))
