# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that a super client finds a fleet through a discovery server, as docs/fleet.md says."""

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from driver_process import PATIENCE_S

DRIVERS = 16
FLEET, OBSERVER = (
    Path(__file__).with_name(name) for name in ("fleet_of_drivers.py", "fleet_observer.py")
)
SERVER = shutil.which("fast-discovery-server", path=f"{sys.prefix}/bin{os.pathsep}{os.defpath}")

pytestmark = pytest.mark.skipif(SERVER is None, reason="fast-discovery-server is not installed")


@contextmanager
def program(
    command: list[str], environment: dict[str, str], ends_within_s: float
) -> Iterator[subprocess.Popen[str]]:
    """Run a program while the context lasts.

    At the end, close the program's input. Kill the program if it still runs after
    ``ends_within_s``.
    """
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
    )
    with process:
        try:
            yield process
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(ends_within_s)
            except subprocess.TimeoutExpired:
                process.kill()


def free_udp_port() -> int:
    """Return a UDP port of the loopback interface that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_a_super_client_finds_16_drivers_through_the_server() -> None:
    """16 drivers are clients of a discovery server. An observer, a super client, finds all of them.

    Clients and super clients use no multicast, so the observer finds them through the server.
    """
    port = str(free_udp_port())
    environment = {
        **os.environ,
        "ROS_DISCOVERY_SERVER": f"127.0.0.1:{port}",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # killed drivers leave no shared memory
    }
    fleet = str(DRIVERS), f"fleet{os.getpid()}_"
    with (
        program([str(SERVER), "-i", "0", "-l", "127.0.0.1", "-p", port], environment, 0.0),
        program([sys.executable, str(FLEET), *fleet], environment, PATIENCE_S),
    ):
        observer = [sys.executable, str(OBSERVER), *fleet]
        as_super_client = {**environment, "ROS_SUPER_CLIENT": "TRUE"}
        subprocess.run(observer, env=as_super_client, check=True, timeout=PATIENCE_S)
