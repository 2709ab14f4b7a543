# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pictures of the monitor's screen: ``python test/pictures/monitor.py docs/pictures``.

A driver runs on a simulated board, and the robot drives a square. The screen has 80x24 characters.
"""

import asyncio
import os
import re
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from omnibot_driver.demo.__main__ import ENVIRONMENT
from omnibot_driver.demo.program import Program

if TYPE_CHECKING:
    from textual.app import App

    from omnibot_driver.tools.monitor.feed import Feed

PATIENCE_S = 60.0


def main(folder: Path) -> None:
    """Write ``monitor.svg`` and ``monitor_estop.svg``."""
    for name, default in ENVIRONMENT.items():
        os.environ[name] = os.environ.get(name) or default
    with ExitStack() as stack:
        driver = Program("driver", "--ros-args", "-p", "port:=sim://")
        stack.callback(driver.end)
        from omnibot_driver.demo.robot import Robot
        from omnibot_driver.tools.monitor.feed import Feed

        robot = Robot("/")
        stack.callback(robot.close)
        feed = Feed([], "", "omnibot_driver")
        stack.callback(feed.close)
        ended = threading.Event()

        def drive() -> None:
            while not ended.is_set():
                robot.driving = not robot.missing()
                robot.spin_once()

        driving = threading.Thread(target=drive)
        driving.start()
        stack.callback(driving.join)
        stack.callback(ended.set)
        asyncio.run(_photograph(feed, lambda: robot.leg == 3 and robot.pose.y_m < 0.4, folder))


async def _photograph(feed: "Feed", driven: Callable[[], bool], folder: Path) -> None:
    from omnibot_driver.tools.monitor.app import Monitor

    app = Monitor(feed)
    async with app.run_test(size=(80, 24)) as pilot:

        async def wait_for(predicate: Callable[[], bool]) -> None:
            async with asyncio.timeout(PATIENCE_S):
                while not predicate():
                    await pilot.pause(0.05)
            app.refresh_view()
            await pilot.pause()

        await wait_for(driven)
        (folder / "monitor.svg").write_text(_picture(app))
        await pilot.press("space")
        await wait_for(
            lambda: any(status.name == "E-stop" and status.level for status in feed.view().statuses)
        )
        (folder / "monitor_estop.svg").write_text(_picture(app))


def _picture(app: "App[None]") -> str:
    """Return the screen as SVG, without the fonts that would be loaded from the network."""
    svg = app.export_screenshot(title="ros2 run omnibot_driver monitor")
    return re.sub(r"@font-face \{.*?\}", "", svg, flags=re.DOTALL).replace("Fira Code, ", "")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
