# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that a replay of the bytes from both Teensys ends at the same pose as the recorded drive."""

import signal
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import pytest

pytest.importorskip("rosbags")

from bag import Recorder
from driver_process import Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from rosbags.rosbag2 import StoragePlugin

RAW: Final = [
    f"omnibot_driver/raw_{way}/{name}" for way in ("rx", "tx") for name in ("drive", "front")
]
RECOGNISED: Final = 100
"""Number of packets from each Teensy that a replay needs to recognise the Teensy.

The recording may lack the Teensys' answers to the driver's questions at the start.
"""


def test_a_recorded_drive_of_both_lines_is_replayed(tmp_path: Path) -> None:
    """A drive is recorded and replayed. The replay ends at the same place in odom, within 1 cm."""
    with ExitStack() as stack:
        driver = stack.enter_context(Driver(port="sim://", board="fejemis", publish_raw="true"))
        probe = stack.enter_context(Probe.of(driver))
        recorder = Recorder(probe)
        recorder.record(*RAW)
        odometry = probe.listen(Odometry, "odom")
        probe.wait_for_state("nominal")
        received = [recorder.messages[f"/{driver.namespace}/{name}"] for name in RAW[:2]]
        probe.wait_for(lambda: min(map(len, received)) > RECOGNISED)
        cmd_vel, twist = probe.publisher(Twist, "cmd_vel"), Twist()
        twist.linear.x = 0.3
        timer = probe.node.create_timer(0.1, lambda: cmd_vel.publish(twist))
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.3)
        probe.remove(timer)
        probe.wait_for(lambda: abs(odometry[-1].twist.twist.linear.x) < 0.001)
        assert driver.end(signal.SIGINT) == 0
        end_m = odometry[-1].pose.pose.position.x
    bag = tmp_path / "bag"
    recorder.write(bag, StoragePlugin.MCAP)
    with ExitStack() as stack:
        port = f"replay://{bag}?speed=5&delay=5"
        again = stack.enter_context(Driver(port=port, board="fejemis"))
        listener = stack.enter_context(Probe.of(again))
        heard = listener.listen(Odometry, "odom")
        again.wait_for_line("the recording has ended")
        ends_there = listener.comes_about(
            lambda: heard and abs(heard[-1].pose.pose.position.x - end_m) < 0.01
        )
        assert ends_there, (end_m, heard[-1:], again.output)
