# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the monitor's dashboard at 80x24 characters, with a fake robot."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from monitor_view import FakeRobot, view
from textual import events
from textual.pilot import Pilot

from omnibot_driver.core.reporting.status import Level, Status
from omnibot_driver.tools.monitor.app import Monitor
from omnibot_driver.tools.monitor.teleop import HALT

LONG = (
    "this sentence is as long as those of the driver are: it says what to do, and so takes a line"
)
ALL_WRONG = tuple(
    Status(name, Level.WARN, LONG, {})
    for name in ("Link", "Board", "Stream", "Time", "Commands", "E-stop", "IMU")
)


def on_screen(robot: FakeRobot, steps: Callable[[Pilot[Any], Monitor], Awaitable[None]]) -> None:
    """Run the dashboard at 80x24 characters without a terminal, and perform ``steps`` on it."""

    async def run() -> None:
        app = Monitor(robot)
        async with app.run_test(size=(80, 24)) as pilot:
            await steps(pilot, app)

    asyncio.run(run())


def screen(app: Monitor) -> list[str]:
    """Return the text on the screen, row by row."""
    return [
        "".join(segment.text for segment in strip)
        for strip in app.screen._compositor.render_strips()
    ]


def press(*keys: str, teleop: bool = False) -> FakeRobot:
    """Press these keys, and return the robot with the requests that it got."""
    robot = FakeRobot(teleop=teleop)

    async def steps(pilot: Pilot[Any], _app: Monitor) -> None:
        await pilot.press(*keys)

    on_screen(robot, steps)
    return robot


@pytest.mark.parametrize("statuses", [view().statuses, ALL_WRONG], ids=["fine", "all wrong"])
def test_everything_fits_80_by_24(statuses: tuple[Status, ...]) -> None:
    """Mode, link, rates, pose, velocities, IMU, faults and keys are all visible at once."""
    robot = FakeRobot(teleop=True)
    robot.shown = view(statuses=statuses, said="start: running")

    async def steps(pilot: Pilot[Any], app: Monitor) -> None:
        await pilot.pause()
        app.refresh_view()
        await pilot.pause()
        rows = screen(app)
        assert [len(row) for row in rows] == [80] * 24
        shown = "\n".join(rows)
        for part in (
            "/robot1/omnibot_driver  nominal",
            "imu/data_raw  100 Hz",
            "odom           25 Hz",
        ):
            assert part in shown
        for part in ("1.50", "-0.25", "28.6", "0.25", "-0.12", "9.80", "0.01", "▇", "→", "m wide"):
            assert part in shown
        for part in ("e-stop not latched", "start: running", "3/10", "E-STOP", "quit", "Link"):
            assert part in shown

    on_screen(robot, steps)


def test_a_latched_estop_is_red() -> None:
    """While the e-stop is latched, a red line names the key that releases it.

    Until the driver's service is found, the key has no effect. So the line does not name it yet.
    """
    robot = FakeRobot()

    async def steps(pilot: Pilot[Any], app: Monitor) -> None:
        assert "latched" not in app.query_one("#estop").classes
        robot.shown = view(estop=True, releasable=False)
        app.refresh_view()
        await pilot.pause()
        assert "E-STOP LATCHED  ·  waiting for the driver's e-stop service" in screen(app)[1]
        robot.shown = view(estop=True)
        app.refresh_view()
        await pilot.pause()
        assert "E-STOP LATCHED  ·  R releases it" in screen(app)[1]
        assert app.query_one("#estop").styles.background.rgb == (255, 0, 0)

    on_screen(robot, steps)


@pytest.mark.parametrize(
    ("key", "asked"),
    [("space", "estop"), ("g", "start"), ("p", "pause"), ("z", "reset_odometry")],
)
def test_a_key_asks_for_what_the_last_line_says(key: str, asked: str) -> None:
    """Each key in the last line of the screen sends exactly one request."""
    assert press(key).asked == [asked]


def test_the_estop_is_released_by_two_keys() -> None:
    """After the key R, the monitor asks whether to release the e-stop.

    The key y confirms, and any other key cancels.
    """
    assert press("R", "y").asked == ["release"]
    answers = ("n", "enter", "escape", "R", "w")
    assert press(*(key for answer in answers for key in ("R", answer)), teleop=True).asked == []


def test_space_stops_even_while_a_question_stands() -> None:
    """The monitor asks whether to release the e-stop, and the user presses the space bar.

    The monitor takes this as the answer "no", and requests the e-stop again.
    """
    assert press("R", "space", "y").asked == ["estop"]


@pytest.mark.parametrize("keys", [["q"], ["ctrl+c"], ["ctrl+q"]])
def test_q_and_what_people_try_instead_leave_the_dashboard(keys: list[str]) -> None:
    """The keys q, ctrl-C and ctrl-Q end the dashboard. The last line of the screen names only q."""
    robot = FakeRobot()

    async def steps(pilot: Pilot[Any], app: Monitor) -> None:
        await pilot.press(*keys)
        await pilot.pause()
        assert not app.is_running

    on_screen(robot, steps)


@pytest.mark.parametrize("key", ["w", "up", "j"])
def test_keys_steer_with_teleop_alone(key: str) -> None:
    """The keys for driving work only with ``--teleop``."""
    robot = press(key, teleop=True)
    assert robot.dead_man
    assert robot.dead_man.command(0.0) not in (None, HALT)
    assert press(key).asked == []


def test_plus_and_minus_change_the_speed() -> None:
    """Plus and minus change the speed by one of ten levels. The monitor begins at level 3."""
    robot = press("plus", "plus", "minus", teleop=True)
    assert robot.dead_man
    assert robot.dead_man.level == 4


def test_who_looks_elsewhere_does_not_steer() -> None:
    """The terminal loses the focus while a key is held. The motion ends."""
    robot = FakeRobot(teleop=True)

    async def steps(pilot: Pilot[Any], app: Monitor) -> None:
        await pilot.press("w")
        assert robot.dead_man
        assert robot.dead_man.command(0.0) != HALT
        app.post_message(events.AppBlur())
        await pilot.pause()
        assert robot.dead_man.command(0.0) == HALT

    on_screen(robot, steps)


def test_nothing_in_a_message_is_markup() -> None:
    """A message has brackets.

    The dashboard shows them unchanged and does not format the message.
    """
    robot = FakeRobot()
    robot.shown = view(said="[/bold] [red", driver="/[b]")

    async def steps(pilot: Pilot[Any], app: Monitor) -> None:
        await pilot.pause()
        assert any("[/bold] [red" in row for row in screen(app))

    on_screen(robot, steps)


def test_a_key_for_what_the_board_cannot_do_is_not_there() -> None:
    """The board lacks a function. The key for this function is hidden and sends no request."""
    robot = FakeRobot()
    robot.shown = view(lacks=frozenset({"pause"}))

    async def steps(pilot: Pilot[Any], app: Monitor) -> None:
        app.refresh_view()
        await pilot.pause()
        await pilot.press("p", "g")
        await pilot.pause()
        footer = screen(app)[-1]
        assert "start" in footer
        assert "pause" not in footer

    on_screen(robot, steps)
    assert robot.asked == ["start"]
