# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A drive over a bad serial line: the published messages are compared with the board's frames.

``python test/system/drive.py SECONDS --lose 0.001`` prints the number of wrong messages, and the
error of ``odom``.
"""

import argparse
import math
import os
import struct
import sys
from bisect import bisect_left
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from random import Random
from typing import Any

ACCEL_LSB = 9.80665 / 16384
GYRO_LSB = math.radians(1 / 131)
TICK_S, PERIOD_S = 0.01, 0.04
SIDEWAYS = 50
"""Number of earlier and of later deltas to search for the delta that matches a message.

The search begins at the delta that fits the message's timestamp.
"""
LONGEST_STALL = 1000
"""Number of earlier and of later frames to search for the IMU frame that matches a message.

After a stall, the frame may be far from the message's timestamp.
"""

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a drive: the driver's messages, compared with the frames of the board.

    ``imu_sent``, ``odom_sent``: number of frames that the board sent, counted from the first frame
    that the driver published.

    ``imu_wrong``, ``odom_wrong``: number of messages that match no frame.

    ``worst_m``, ``worst_rad``: largest difference between ``odom`` and the pose of the board.

    ``last_m``, ``last_rad``: the difference in the last message.
    """

    seconds: float
    way_m: float
    bytes_lost: int
    bytes_flipped: int
    imu_sent: int
    imu_received: int
    imu_wrong: int
    odom_sent: int
    odom_received: int
    odom_wrong: int
    worst_m: float
    worst_rad: float
    last_m: float
    last_rad: float

    def __str__(self) -> str:
        return (
            f"driven      {self.way_m:.1f} m in {self.seconds:.0f} s\n"
            f"line        {self.bytes_lost} bytes lost, {self.bytes_flipped} bits flipped\n"
            f"imu         {self.imu_received} of {self.imu_sent}, {self.imu_wrong} wrong\n"
            f"odom        {self.odom_received} of {self.odom_sent}, {self.odom_wrong} wrong\n"
            f"pose error  {1000 * self.worst_m:.1f} mm, {1000 * self.worst_rad:.1f} mrad at worst; "
            f"{1000 * self.last_m:.1f} mm, {1000 * self.last_rad:.1f} mrad at the end"
        )


def drive(seconds: float, *, lose: float = 0.0, burst: float = 0.0, flip: float = 0.0) -> Outcome:
    """Drive for ``seconds``, stand still for 2 s, and compare the messages with the board's frames.

    The caller must have initialised rclpy.
    """
    from driver_process import PATIENCE_S, Driver
    from geometry_msgs.msg import Twist
    from nav_msgs.msg import Odometry
    from probe import Probe
    from sensor_msgs.msg import Imu

    from omnibot_driver.simulator.omnibot import (
        BoardSettings,
        FaultyLine,
        LineFaults,
        PtyBoard,
        SimulatedBoard,
    )

    board = SimulatedBoard(BoardSettings(seed=1))
    board.sent = deque()  # keeps all frames
    line = FaultyLine(LineFaults(lose=lose, burst=burst, flip=flip), seed=1)
    with ExitStack() as stack:
        port = stack.enter_context(PtyBoard(board, line=line))
        driver = stack.enter_context(Driver(port=port.path))
        probe = stack.enter_context(Probe.of(driver))
        imu, odom = probe.listen(Imu, "imu/data_raw"), probe.listen(Odometry, "odom")
        try:
            probe.wait_for_state("nominal")
        except AssertionError as error:
            raise AssertionError(f"the board does not run:\n{driver.output}") from error
        cmd_vel = probe.publisher(Twist, "cmd_vel")
        random = Random("drive")
        phases = [random.uniform(0.0, math.tau) for _ in range(3)]
        start_tick = board.tick
        steered = -1

        def steer(board: SimulatedBoard) -> bool:
            nonlocal steered
            passed = board.tick - start_tick
            if passed // 5 > steered:
                steered = passed // 5
                t, twist = passed * TICK_S, Twist()
                twist.linear.x = 0.3 * math.sin(0.9 * t + phases[0])
                twist.linear.y = 0.3 * math.sin(1.3 * t + phases[1])
                twist.angular.z = 0.45 * math.sin(0.5 * t + phases[2])
                cmd_vel.publish(twist)
            return passed * TICK_S >= seconds

        port.wait_for(steer, 2 * seconds + PATIENCE_S)
        cmd_vel.publish(Twist())
        port.wait_for(lambda board: board.tick >= start_tick + (seconds + 2.0) / TICK_S, PATIENCE_S)
        with port.lock:
            sent = [frame.data for frame in board.sent]
        return compare(sent, list(imu), list(odom), seconds, line)


def compare(
    sent: Sequence[bytes], imu: Sequence[Any], odom: Sequence[Any], seconds: float, line: Any
) -> Outcome:
    words = [struct.unpack(">6h", data[2:]) for data in sent if data[:2] == b"\xff\xfa"]
    imu_at = [_stamp(message) for message in imu]
    imu_found = trace(words, [_words(message) for message in imu], imu_at)
    deltas, poses, numbers = board_poses(sent)
    keys = [(round(math.hypot(dx, dy), 3), turn) for dx, dy, turn in deltas]
    odom_found: list[int | None] = []
    last = -1
    for message in odom:
        middle = bisect_left(numbers, expected(_stamp(message), imu_found, imu_at))
        key = _displacement(message)
        around = outwards(middle, SIDEWAYS)
        number = next((n for n in around if last < n < len(keys) and keys[n] == key), None)
        odom_found.append(number)
        last = last if number is None else number
    errors = []
    for message, number in zip(odom, odom_found, strict=True):
        if number is not None:
            x, y, yaw = poses[number]
            position, turn = message.pose.pose.position, message.pose.pose.orientation
            off_yaw = math.remainder(2 * math.atan2(turn.z, turn.w) - yaw, math.tau)
            errors.append((math.hypot(position.x - x, position.y - y), abs(off_yaw)))
    way_m = sum(math.hypot(dx, dy) * 1e-4 for dx, dy, _ in deltas)
    return Outcome(
        seconds,
        way_m,
        line.lost,
        line.flipped,
        len(words) - since(imu_found),
        len(imu),
        imu_found.count(None),
        len(deltas) - since(odom_found),
        len(odom),
        odom_found.count(None),
        max(error for error, _ in errors),
        max(error for _, error in errors),
        *errors[-1],
    )


def trace(
    sent: Sequence[object], got: Sequence[object], stamps_s: Sequence[float]
) -> list[int | None]:
    """Return for each IMU message the index of the frame with the same values, or None.

    Noise makes each frame unique. ``sent``: values of the frames. ``got``, ``stamps_s``: values and
    timestamps of the messages.
    """
    found: list[int | None] = []
    at, at_s = -1, stamps_s[0]
    for key, stamp_s in zip(got, stamps_s, strict=True):
        middle = at + max(1, round((stamp_s - at_s) / TICK_S))
        around = outwards(middle, LONGEST_STALL)
        number = next((n for n in around if at < n < len(sent) and sent[n] == key), None)
        if number is not None:
            at, at_s = number, stamp_s
        found.append(number)
    return found


def since(found: Sequence[int | None]) -> int:
    """Return the index of the first frame for which the listener received a message.

    Earlier frames were sent before the listener was ready.
    """
    return next(number for number in found if number is not None)


def outwards(middle: int, reach: int) -> Iterator[int]:
    """Yield ``middle``, then the numbers up to ``reach`` away from it, the nearest first."""
    yield middle
    for distance in range(1, reach + 1):
        yield from (middle + distance, middle - distance)


def expected(stamp_s: float, found: Sequence[int | None], stamps_s: Sequence[float]) -> int:
    """Estimate the index of the IMU frame that was sampled at ``stamp_s``.

    The estimate is based on a message that was sampled near this time and whose frame is known.
    """
    place = min(bisect_left(stamps_s, stamp_s), len(stamps_s) - 1)
    while (number := found[place]) is None:
        place -= 1
    return number + round((stamp_s - stamps_s[place]) / TICK_S)


def board_poses(
    sent: Sequence[bytes],
) -> tuple[list[tuple[int, int, int]], list[Triple], list[int]]:
    """Return the deltas in a board's frames, the pose after each delta, and an IMU index for each.

    * Pose: the last exact pose from the board plus the rounded deltas since then.
    * IMU index: the index of the last IMU frame before the delta.
    """
    deltas: list[tuple[int, int, int]] = []
    poses: list[Triple] = []
    numbers: list[int] = []
    x = y = yaw = 0.0
    number = -1
    for data in sent:
        number += data[:2] == b"\xff\xfa"
        if data[:2] == b"\xff\xfb":
            dx, dy, turn = struct.unpack(">3h", data[2:8])
            x, y, yaw = x + dx * 1e-4, y + dy * 1e-4, yaw + turn * 1e-4
            deltas.append((dx, dy, turn))
            poses.append((x, y, yaw))
            numbers.append(number)
        elif data[:2] == b"\xff\xfc":
            x, y, yaw = (value / 1000 for value in struct.unpack(">3f", data[2:14]))
            poses[-1] = (x, y, yaw)
    return deltas, poses, numbers


def _words(message: Any) -> tuple[int, ...]:
    force, rate = message.linear_acceleration, message.angular_velocity
    return (
        *(round(value / ACCEL_LSB) for value in (force.x, force.y, force.z)),
        *(round(value / GYRO_LSB) for value in (rate.x, rate.y, rate.z)),
    )


def _displacement(message: Any) -> tuple[float, int]:
    """Return the length and turn of the displacement from which a message's twist was computed.

    The length is in 0.1 mm, and the turn in 0.1 mrad.
    """
    twist = message.twist.twist
    turn = twist.angular.z * PERIOD_S
    shrink = math.sin(turn / 2) / (turn / 2) if turn else 1.0
    length = math.hypot(twist.linear.x, twist.linear.y) * PERIOD_S * shrink
    return round(length * 1e4, 3), round(turn * 1e4)


def _stamp(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


def main() -> int:
    """Drive and print the outcome. Return 1 if a message was wrong, else 0."""
    parser = argparse.ArgumentParser(description="A drive over a bad line, end to end.")
    parser.add_argument("seconds", type=float)
    for fault in ("lose", "burst", "flip"):
        parser.add_argument(f"--{fault}", type=float, default=0.0, metavar="RATE")
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 101))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    import rclpy

    rclpy.init()
    try:
        outcome = drive(
            arguments.seconds, lose=arguments.lose, burst=arguments.burst, flip=arguments.flip
        )
    finally:
        rclpy.try_shutdown()
    print(outcome)
    return 1 if outcome.imu_wrong or outcome.odom_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
