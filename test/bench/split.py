# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Timers that measure the processor time of each stage of the driver's reader.

The driver's process imports this module first. At the end of the process, the module writes the
times in s, as JSON, to the file that the environment variable SPLIT names. The key ``passed`` has
the elapsed time for which the reader ran.
"""

import atexit
import json
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.publisher import Publisher

from omnibot_driver.core.inbound import Inbound
from omnibot_driver.core.omnibot.decoder import FrameDecoder
from omnibot_driver.publishing import Publishing
from omnibot_driver.transports.serial_port import SerialPort

spent: dict[str, float] = {}
within: list[float] = []


def timed(owner: type, name: str, stage: str) -> None:
    """Replace a method by one that also measures its processor time in the reader's thread.

    The time is added to the total of ``stage``. Calls of other measured methods are not included.
    """
    method: Callable[..., Any] = getattr(owner, name)

    def measured(*arguments: Any) -> Any:
        if threading.current_thread().name != "omnibot-reader":
            return method(*arguments)
        within.append(0.0)
        began = time.monotonic()
        begun = time.thread_time()
        try:
            return method(*arguments)
        finally:
            passed = time.thread_time() - begun
            if len(within) == 1:
                spent["passed"] = time.monotonic() - began
            spent[stage] = spent.get(stage, 0.0) + passed - within.pop()
            if within:
                within[-1] += passed

    setattr(owner, name, measured)


timed(SerialPort, "read", "read")
timed(FrameDecoder, "feed", "decode")
timed(Inbound, "hear", "measure (clock, plausibility, odometry, IMU)")
timed(Inbound, "process", "measure (clock, plausibility, odometry, IMU)")
timed(Publishing, "deliver", "convert (stamps, serialising)")
timed(Publisher, "publish", "publish")
timed(threading.Thread, "run", "the rest of the reader (lock, commands due, state)")

atexit.register(lambda: Path(os.environ["SPLIT"]).write_text(json.dumps(spent)))
