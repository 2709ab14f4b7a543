# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The monitor's screen. A ``Robot`` provides its values, and carries out what the keys request.

The module knows terminals and keys; it does not know ROS.
"""

import asyncio
import codecs
import signal
import time
from functools import partial
from typing import ClassVar, Final, Protocol

from rich.text import Text
from textual import events
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.drivers import linux_driver
from textual.screen import ModalScreen
from textual.widgets import Footer, Static

from omnibot_driver.core.reporting.status import Level
from omnibot_driver.tools.monitor import text
from omnibot_driver.tools.monitor.model import View
from omnibot_driver.tools.monitor.plot import ARROWS, draw_path
from omnibot_driver.tools.monitor.teleop import LEVELS, DeadMan

# Textual decodes keys strictly: one byte that is not UTF-8, from line noise or from a terminal with
# another encoding, would end the monitor, and the e-stop key with it.
linux_driver.getincrementaldecoder = lambda encoding: partial(  # type: ignore[attr-defined]
    codecs.getincrementaldecoder(encoding), errors="replace"
)

REFRESH_S: Final = 0.2
PARTS: Final = ("title", "estop", "path", "figures", "verdicts", "teleop", "said")
MOST_IN_FULL: Final = 4
"""Largest number of texts about diagnostics that are shown in full. If there are more, each text is
cut to one line."""
GREEN, YELLOW, RED, GREY, CYAN = "#98e024", "#f4bf4f", "#ff5f57", "#a0a0a0", "#58d1eb"
COLOURS: Final = {
    Level.OK: GREEN,
    Level.WARN: YELLOW,
    Level.ERROR: f"bold {RED}",
    Level.STALE: GREY,
}
STATES: Final = {"nominal": GREEN, "imu_only": YELLOW, "paused": YELLOW}


class Robot(Protocol):
    """What the screen needs from a robot: values to show, and actions for the keys.

    Each method returns at once.
    """

    dead_man: DeadMan | None

    def view(self) -> View:
        """Return the values to show now."""

    def estop(self) -> None:
        """Latch the e-stop."""

    def release(self) -> None:
        """Release the e-stop."""

    def start(self) -> None:
        """Start the board."""

    def pause(self) -> None:
        """Pause the board."""

    def reset_odometry(self) -> None:
        """Set the odometry to zero."""


class Release(ModalScreen[bool]):
    """The question whether to release the e-stop: y releases it, every other key does not."""

    def compose(self) -> ComposeResult:
        """Build the question."""
        yield Static(
            "Release the e-stop?\n\nIs everybody clear of the robot?\nThe robot stays stopped"
            " until the next command.\n\ny: release the e-stop\nany other key: keep it",
            markup=False,
        )

    def on_key(self, event: events.Key) -> None:
        """Close this screen, and release the e-stop if the key is y."""
        event.stop()
        self.dismiss(event.key == "y")


class Monitor(App[None]):
    """The screen of one robot."""

    ENABLE_COMMAND_PALETTE = False
    CSS = """
    #title, #estop, #teleop { height: 1; padding: 0 1; }
    #title { background: $panel; }
    #estop { color: $text-muted; }
    #estop.latched { background: red; color: white; text-style: bold; text-align: center; }
    #middle { height: 1fr; min-height: 8; }
    #path { width: 1fr; height: 1fr; border: round $foreground-muted; }
    #figures { width: 44; height: 1fr; padding: 0 0 0 1; }
    #verdicts { height: auto; max-height: 10; padding: 0 1; }
    #said { height: auto; max-height: 2; min-height: 1; padding: 0 1; background: $panel; }
    Release { align: center middle; }
    Release Static { width: 48; height: auto; padding: 1 2; border: heavy red;
                     background: $surface; text-align: center; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "estop", "E-STOP", priority=True),
        Binding("R", "release", "release it", key_display="R"),
        Binding("g", "start", "start"),
        Binding("p", "pause", "pause"),
        Binding("z", "reset_odometry", "zero odometry"),
        Binding("q,ctrl+c", "quit", "quit", key_display="q"),
    ]

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._robot = robot
        self._lacks: frozenset[str] = frozenset()
        self._parts = {name: Static(id=name, markup=False) for name in PARTS}

    def compose(self) -> ComposeResult:
        """Build the screen from top to bottom."""
        parts = self._parts
        yield from (parts["title"], parts["estop"])
        yield Horizontal(parts["path"], parts["figures"], id="middle")
        yield parts["verdicts"]
        if self._robot.dead_man:
            yield parts["teleop"]
        yield parts["said"]
        yield Footer()

    def on_mount(self) -> None:
        """Begin to draw the screen regularly, and to handle signals."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self.exit)
        # A signal during a write must not call Textual's handler, which waits for the write to end.
        if callable(leave := signal.getsignal(signal.SIGTSTP)):
            loop.add_signal_handler(signal.SIGTSTP, leave, signal.SIGTSTP, None)
        loop.add_signal_handler(signal.SIGCONT, self._come_back)
        self.set_interval(REFRESH_S, self.refresh_view)
        self.refresh_view()

    def _come_back(self) -> None:
        """Draw the screen again after a suspension by SIGSTOP."""
        # Textual's ``suspend`` ends the thread that reads keys. After the empty block, Textual
        # draws the screen, and starts a new such thread. If the old thread still ran, both would
        # read keys.
        with self.suspend():
            pass

    def refresh_view(self) -> None:
        """Draw the screen with the robot's present values."""
        view = self._robot.view()
        if view.lacks != self._lacks:
            self._lacks = view.lacks
            self.refresh_bindings()
        self._show_title(view)
        line = self._parts["estop"]
        line.set_class(bool(view.estop) or view.estop_asked, "latched")
        hint = "R releases it" if view.releasable else "waiting for the driver's e-stop service"
        line.update(f"{text.estop(view)}  ·  {hint}" if view.estop else text.estop(view))
        self._show_path(view)
        self._parts["figures"].update(Text("\n".join(text.figures(view))))
        self._show_verdicts(view)
        self._parts["said"].update(Text(text.clean(view.said)))
        if self._robot.dead_man:
            self._show_teleop(self._robot.dead_man, view.steers)

    def _show_title(self, view: View) -> None:
        colour = RED if view.silent else STATES.get(view.state, RED)
        self._parts["title"].update(Text(text.title(view), f"bold {colour}"))

    def _show_path(self, view: View) -> None:
        plot = self._parts["path"]
        picture = draw_path(view.path, plot.content_size.width, plot.content_size.height, view.pose)
        plot.border_title = "odom, x → y ↑"
        plot.border_subtitle = f"{picture.width_m:.2f} m wide"
        drawn = Text("\n".join(picture.rows), CYAN)
        drawn.highlight_regex(f"[{ARROWS}]", f"bold {YELLOW}")
        plot.update(drawn)

    def _show_verdicts(self, view: View) -> None:
        verdicts = text.verdicts(view)
        columns = self._parts["verdicts"].content_size.width
        longest = columns if len(verdicts) > MOST_IN_FULL else None
        lines = [Text(words[:longest], COLOURS[level]) for level, words in verdicts]
        self._parts["verdicts"].update(Text("\n").join([*lines, Text(text.counts(view))]))

    def _show_teleop(self, dead_man: DeadMan, steers: bool) -> None:
        linear, angular = dead_man.speeds
        words = (
            f"steer: WASD or arrows, J L turn, +/- speed {dead_man.level}/{LEVELS}: "
            f"{linear:.2f} m/s {angular:.2f} rad/s"
        )
        self._parts["teleop"].update(
            Text(words if steers else "steer: no subscriber on cmd_vel yet")
        )

    # Keys

    def on_key(self, event: events.Key) -> None:
        """Steer the robot if the key is a steering key; change its speed if the key is + or -."""
        dead_man = self._robot.dead_man
        if dead_man is None:
            return
        if dead_man.press(event.key, time.monotonic()):
            event.stop()
        elif event.key in ("plus", "minus"):
            dead_man.change_speed(1 if event.key == "plus" else -1)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return False for an action that the robot's board does not support, to hide its key."""
        return action not in self._lacks and super().check_action(action, parameters)

    def on_app_blur(self) -> None:
        """Stop steering the robot when the terminal loses the focus."""
        if self._robot.dead_man:
            self._robot.dead_man.stop()

    def action_estop(self) -> None:
        """Latch the e-stop at once, even while the question about its release is shown."""
        self._robot.estop()
        if isinstance(self.screen, Release):
            self.screen.dismiss(False)

    def action_release(self) -> None:
        """Ask the user whether to release the e-stop, and release it if the answer is yes."""
        self.push_screen(Release(), lambda sure: self._robot.release() if sure else None)

    def action_start(self) -> None:
        """Start the board."""
        self._robot.start()

    def action_pause(self) -> None:
        """Pause the board."""
        self._robot.pause()

    def action_reset_odometry(self) -> None:
        """Set the odometry to zero."""
        self._robot.reset_odometry()
