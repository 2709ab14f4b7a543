"""A real driver process on a breakable line, somebody who drives it, and the judgement of it all.

What is judged: whether the robot stood still in time, whether every message published was sent by
the board, whether the odometry went on without a jump, what the process costs.
"""

import math
import os
import re
import struct
import threading
import time
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, Self

from breakable_line import TICK_S, BreakableLine
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, String

from omnibot_driver.messages import UNMEASURED_VARIANCE
from omnibot_driver.simulator import BoardSettings, PtyBoard

TIMEOUT_S: Final = 0.5
"""``cmd_vel_timeout``."""
GRACE_S: Final = 0.1
"""Of stream, after the timeout."""
FASTEST_MPS, FASTEST_RADPS = 2.0, 8.0
DRIVE_HZ: Final = 20.0
NEW_VARIANCE: Final = 1e-4
"""Of x, soon after somebody had the odometry begin anew."""
WRONG_ONE_IN: Final = 500
"""Of the messages, while a byte in a hundred is lost."""


@dataclass(slots=True)
class Findings:
    """What went wrong; empty is good."""

    complaints: list[str] = field(default_factory=list)
    stood_after_s: list[float] = field(default_factory=list)
    """How long after it had to the robot was told to stand, by the board's clock."""
    published: int = 0
    wrong: int = 0

    def expect(self, holds: object, complaint: str) -> None:
        if not holds:
            self.complaints.append(complaint)

    def take(self) -> list[str]:
        """The complaints since the last time."""
        complaints, self.complaints = self.complaints, []
        return complaints


class Rig:
    """Context manager. The driver's port is a symbolic link, as udev makes them."""

    def __init__(self, folder: Path, *, grace_s: float = GRACE_S) -> None:
        self._grace_s = grace_s
        self.line = BreakableLine(BoardSettings())
        self.findings = Findings()
        self.port = str(folder / "omnibot")
        self._stack = ExitStack()
        self._unplugged_at_s: float | None = None
        self._terminal: PtyBoard | None = None

    def __enter__(self) -> Self:
        self.plug()
        self._stack.callback(self.unplug)
        self.driver = self._stack.enter_context(Driver(port=self.port))
        self.probe = self._stack.enter_context(Probe(self.driver.namespace))
        self.imu = self.probe.listen(Imu, "imu/data_raw")
        self.odom = self.probe.listen(Odometry, "odom")
        self.states = self.probe.listen(String, "omnibot_driver/state", latched=True)
        self.estops = self.probe.listen(Bool, "omnibot_driver/estop_active", latched=True)
        self.probe.wait_for_state("nominal")
        self.hand = Hand(self.probe)
        self._stack.callback(self.hand.leave)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    # The line

    def unplug(self) -> None:
        """The terminal goes away; the robot does what it was told last."""
        if self._terminal is not None:
            self._terminal.__exit__(None, None, None)
            self._terminal, self._unplugged_at_s = None, time.monotonic()

    def plug(self) -> None:
        """A new terminal, hardly of the old name, behind the old link."""
        if self._unplugged_at_s is not None:
            for _ in range(round((time.monotonic() - self._unplugged_at_s) / TICK_S)):
                self.line.step()
        self._terminal = PtyBoard(self.line, self.port).__enter__()  # type: ignore[arg-type]

    def reboot_board(self) -> None:
        """A power cycle."""
        assert self._terminal is not None
        with self._terminal.lock:
            self.line.board.reboot()

    def wait_for_board(self, predicate: Any) -> bool:
        """Asked after each of the board's ticks."""
        assert self._terminal is not None
        return self._terminal.wait_for(predicate, PATIENCE_S)

    def wait_ticks(self, ticks: int) -> None:
        end = self.line.tick + ticks
        assert self.wait_for_board(lambda line: line.tick >= end), "the board stands still"

    # What is to be seen

    def drive(self, vx: float = 0.3, vy: float = 0.0, yaw_rate: float = 0.2) -> None:
        """Somebody drives until told to leave; returns once the motors turn."""
        self.hand.hold(vx, vy, yaw_rate)
        assert self.wait_for_board(lambda line: line.board.driven), self.driver.output

    def expect_still(self, since_tick: int, what: str, allowed_s: float = TIMEOUT_S) -> None:
        """From ``since_tick`` on the motors may be driven for so long, and not again."""
        ticks = round((allowed_s + self._grace_s) / TICK_S)
        self.wait_ticks(max(0, since_tick + ticks + 50 - self.line.tick))
        stood_s = max(0, self.line.driven_at - since_tick) * TICK_S
        self.findings.stood_after_s.append(stood_s)
        self.findings.expect(
            stood_s <= allowed_s + self._grace_s,
            f"{what}: motors driven for {stood_s:.2f} s, allowed {allowed_s + self._grace_s:.2f} s",
        )

    def expect_obeys_again(self) -> None:
        """A fresh command moves the robot; it stands when the hand leaves."""
        self.probe.wait_for_state("nominal")
        self.drive()
        self.hand.leave()
        self.expect_still(self.line.tick, "afterwards")

    def judge_stream(self, damaged_bytes: bool = False) -> None:
        """All that was published against all that was sent, and the odometry by itself.

        ``damaged_bytes``: bytes were lost or added; framing has a bound then, and it is not zero.
        """
        imu, odom, sent = list(self.imu), list(self.odom), list(self.line.sent)
        one_in = WRONG_ONE_IN if damaged_bytes else math.inf
        for what, wrong, out in (
            ("Imu", not_sent(map(imu_key, imu), map(sent_imu_key, sent)), len(imu)),
            ("Odometry", not_sent(map(odom_key, odom), map(sent_odom_key, sent)), len(odom)),
        ):
            self.findings.wrong += wrong
            self.findings.expect(
                wrong <= out / one_in, f"{wrong} of {out} {what} messages were never sent"
            )
        for before, after in pairwise(odom):
            seconds = stamp_s(after) - stamp_s(before)
            self.findings.expect(seconds > 0, f"stamps of odom {seconds:g} s apart")
            a, b = before.pose.pose.position, after.pose.pose.position
            step_m = math.hypot(b.x - a.x, b.y - a.y)
            possible = step_m <= FASTEST_MPS * max(seconds, 0.04) + 0.005
            zeroed = math.hypot(b.x, b.y) < 0.05 and after.pose.covariance[0] < NEW_VARIANCE
            self.findings.expect(
                possible or zeroed, f"odom jumped by {step_m:.3f} m in {seconds:.3f} s"
            )
        refused = sum(
            int(number)
            for number in re.findall(r"(\d+) readings cannot be true", self.driver.output)
        )
        self.findings.expect(  # what framing made up of damaged bytes may be among them
            refused <= len(imu) / one_in, f"{refused} readings were refused, and no bit was flipped"
        )
        backwards = sum(stamp_s(b) <= stamp_s(a) for a, b in pairwise(imu))
        self.findings.expect(backwards == 0, f"{backwards} imu stamps do not increase")
        self.findings.published += len(imu) + len(odom)

    def cost(self) -> tuple[int, int]:
        """Open descriptors, and resident kB."""
        folder = Path(f"/proc/{self.driver.process.pid}")
        status = (folder / "status").read_text()
        kilobytes = int(status.split("VmRSS:")[1].split()[0])
        return len(os.listdir(folder / "fd")), kilobytes


class Hand:
    """Somebody at the stick: publishes a velocity at 20 Hz until it leaves."""

    def __init__(self, probe: Probe) -> None:
        self._publisher = probe.publisher(Twist, "cmd_vel")
        self._left = threading.Event()
        self._twist = Twist()
        self._thread: threading.Thread | None = None

    def hold(self, vx: float, vy: float, yaw_rate: float) -> None:
        twist = Twist()
        twist.linear.x, twist.linear.y, twist.angular.z = vx, vy, yaw_rate
        self._twist = twist
        if self._thread is None:
            self._left.clear()
            self._thread = threading.Thread(target=self._publish)
            self._thread.start()

    def leave(self) -> None:
        """The last command has been published when this returns."""
        if self._thread is not None:
            self._left.set()
            self._thread.join()
            self._thread = None

    def _publish(self) -> None:
        while not self._left.wait(1 / DRIVE_HZ):
            self._publisher.publish(self._twist)


def stamp_s(message: Imu | Odometry) -> float:
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


Key = tuple[float, ...]
_ACCEL: Final = 9.80665 / 16384
_GYRO: Final = math.radians(1 / 131)


def imu_key(message: Imu) -> Key:
    """In the sensor's counts."""
    a, w = message.linear_acceleration, message.angular_velocity
    return a.x / _ACCEL, a.y / _ACCEL, a.z / _ACCEL, w.x / _GYRO, w.y / _GYRO, w.z / _GYRO


def sent_imu_key(frame: bytes) -> Key | None:
    return struct.unpack(">6h", frame[2:]) if frame[:2] == b"\xff\xfa" else None


def odom_key(message: Odometry) -> Key | None:
    """Speed in 0.1 mm and yaw rate in 0.1 mrad per 40 ms: the heading changes neither."""
    v = message.twist.twist
    unknown = message.twist.covariance[0] >= UNMEASURED_VARIANCE
    return None if unknown else (math.hypot(v.linear.x, v.linear.y) * 400.0, v.angular.z * 400.0)


def sent_odom_key(frame: bytes) -> Key | None:
    if frame[:2] != b"\xff\xfb":
        return None
    dx, dy, dtheta = struct.unpack(">3h", frame[2:8])
    return math.hypot(dx, dy), dtheta


def not_sent(published: Iterable[Key | None], sent: Iterable[Key | None]) -> int:
    """How many of what was published do not occur in what was sent, in its order."""
    truth = [key for key in sent if key is not None]
    at = missing = 0
    for key in published:
        if key is None:
            continue
        place = next((n for n in range(at, len(truth)) if same(key, truth[n])), None)
        if place is None:
            missing += 1
        else:
            at = place + 1
    return missing


def same(published: Key, sent: Key) -> bool:
    return all(abs(a - b) < 0.5 for a, b in zip(published, sent, strict=True))
