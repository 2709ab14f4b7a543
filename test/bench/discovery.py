# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Measure the cost of discovery in a fleet, with and without a Fast DDS discovery server.

The output is rows of the table in docs/fleet.md. Run this as root, in a network namespace without
other traffic:

    unshare --net .venv/bin/python test/bench/discovery.py [NUMBER ...]
"""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
SERVER: Final = Path(sys.prefix, "bin/fast-discovery-server")
PORT: Final = "11811"
WINDOW_S: Final = 30.0
"""Length of a measurement window, in s."""
SETTLE_S: Final = 10.0
"""Time in s for the drivers to start, and for the last packets of a search for drivers to arrive.

No event reports the last packet.
"""
TICK_S: Final = 1.0 / os.sysconf("SC_CLK_TCK")
FIND: Final = """
import sys, time, rclpy
from omnibot_driver.tools.drivers import running_drivers
rclpy.init()
node, begun = rclpy.create_node("observer"), time.monotonic()
while len(running_drivers(node)) < int(sys.argv[1]):
    rclpy.spin_once(node, timeout_sec=0.05)
print(time.monotonic() - begun)
"""


def packets_and_bytes() -> tuple[int, int]:
    """Return the numbers of packets and bytes that have arrived over the loopback so far."""
    line = next(row for row in Path("/proc/net/dev").read_text().splitlines() if " lo:" in row)
    words = line.partition(":")[2].split()
    return int(words[1]), int(words[0])


def processor_s(pids: list[int]) -> float:
    """Return the processor time of these processes so far, user and system, in s."""
    total = 0
    for pid in pids:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        total += int(words[11]) + int(words[12])
    return total * TICK_S


def measure(number: int, *, served: bool) -> str:
    """Measure traffic and processor time of ``number`` drivers, and return a row of the table.

    ``served``: whether the drivers use the discovery server.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }
    server = None
    if served:
        environment["ROS_DISCOVERY_SERVER"] = f"127.0.0.1:{PORT}"
        server = subprocess.Popen(
            [SERVER, "-i", "0", "-l", "127.0.0.1", "-p", PORT],
            stdout=subprocess.DEVNULL,
            env=environment,
        )
    before = packets_and_bytes()
    fleet = subprocess.Popen(
        [sys.executable, str(ROOT / "test/system/fleet_of_drivers.py"), str(number), "robot"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
    )
    assert fleet.stdout is not None
    drivers = [int(word) for word in fleet.stdout.readline().split()]
    time.sleep(SETTLE_S)
    started = packets_and_bytes()
    found = subprocess.run(
        [sys.executable, "-c", FIND, str(number)],
        env={**environment, "ROS_SUPER_CLIENT": "TRUE"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    time.sleep(SETTLE_S)
    watched = drivers + ([server.pid] if server else [])
    first, first_s = packets_and_bytes(), processor_s(watched)
    start_s = processor_s(drivers) / number
    time.sleep(WINDOW_S)
    last, last_s = packets_and_bytes(), processor_s(watched)
    fleet.communicate("")
    if server:
        server.kill()
        server.wait()
    rate = [(late - early) / WINDOW_S for early, late in zip(first, last, strict=True)]
    start = [late - early for early, late in zip(before, started, strict=True)]
    return (
        f"| {number} | {'server' if served else 'multicast'}"
        f" | {start[0]:,} | {start[1] / 1e6:.2f} MB"
        f" | {start_s:.2f} s | {float(found.stdout):.1f} s | {rate[0]:.0f} | {rate[1] / 1e3:.1f} kB"
        f" | {100 * (last_s - first_s) / WINDOW_S / number:.2f} % |"
    )


def main() -> None:
    """Print the rows of the table."""
    for words in (
        ["link", "set", "lo", "up", "multicast", "on"],
        ["route", "add", "224.0.0.0/4", "dev", "lo"],
    ):
        subprocess.run(["ip", *words], check=True)
    for number in map(int, sys.argv[1:] or ("4", "16")):
        for served in (False, True):
            print(measure(number, served=served), flush=True)


if __name__ == "__main__":
    main()
