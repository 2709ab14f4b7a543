# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A fleet that discovers itself through a Fast DDS discovery server, as docs/fleet.md says."""

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rclpy
from driver_process import PATIENCE_S
from rclpy.executors import SingleThreadedExecutor

from omnibot_driver.tools.drivers import running_drivers

DRIVERS = 16
FLEET = Path(__file__).with_name("fleet_of_drivers.py")
SERVER = shutil.which("fast-discovery-server", path=f"{sys.prefix}/bin{os.pathsep}{os.defpath}")

pytestmark = pytest.mark.skipif(SERVER is None, reason="fast-discovery-server is not installed")


@contextmanager
def program(*command: str) -> Iterator[subprocess.Popen[str]]:
    """Run a program that ends with its input, at the latest by a kill."""
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    with process:
        try:
            yield process
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(1.0)
            except subprocess.TimeoutExpired:
                process.kill()


def free_udp_port() -> int:
    """A port of the loopback that no program uses now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_a_super_client_finds_16_drivers_through_the_server(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every participant is a client of the server, so none is discovered by multicast."""
    port = str(free_udp_port())
    monkeypatch.setenv("ROS_DISCOVERY_SERVER", f"127.0.0.1:{port}")
    monkeypatch.setenv(
        "FASTDDS_BUILTIN_TRANSPORTS", "UDPv4"
    )  # killed drivers leave no shared memory
    prefix = f"fleet{os.getpid()}_"
    names = {f"/{prefix}{number}/omnibot_driver" for number in range(DRIVERS)}
    with (
        program(str(SERVER), "-i", "0", "-l", "127.0.0.1", "-p", port),
        program(sys.executable, str(FLEET), str(DRIVERS), prefix),
    ):
        monkeypatch.setenv("ROS_SUPER_CLIENT", "TRUE")
        context = rclpy.Context()
        rclpy.init(context=context)
        try:
            node = rclpy.create_node("observer", context=context)
            executor = SingleThreadedExecutor(context=context)
            executor.add_node(node)
            end_ns = node.get_clock().now().nanoseconds + int(PATIENCE_S * 1e9)
            while set(running_drivers(node)) != names:
                assert node.get_clock().now().nanoseconds < end_ns, running_drivers(node)
                executor.spin_once(timeout_sec=0.1)
            executor.shutdown()
            node.destroy_node()
        finally:
            rclpy.try_shutdown(context=context)
