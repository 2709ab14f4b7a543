# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that compare config/fejemis.policy.xml with the running driver of a Fejemis."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from driver_process import Driver
from probe import Probe
from rclpy.node import NodeNameNonExistentError
from sensor_msgs.msg import Imu
from test_security_policy import Rules, allowed, seen
from two_ports import TwoPorts

from omnibot_driver.simulator.fejemis import SimulatedFejemis

POLICY: Final = Path(__file__).parents[3] / "config" / "fejemis.policy.xml"


def rules() -> dict[str, Rules]:
    """Return the rules of each enclave in the policy. The keys are the paths of the enclaves."""
    enclaves = ElementTree.parse(POLICY).getroot().iter("enclave")
    return {one.attrib["path"]: allowed(next(one.iter("profile"))) for one in enclaves}


def test_the_driver_may_do_what_it_does_and_nothing_else(
    stack: ExitStack, tmp_path: Path, start_driver: Callable[..., Any], probe_of: Any
) -> None:
    """The policy allows exactly the topics and services that the driver has in the ROS graph."""
    robot = stack.enter_context(TwoPorts(SimulatedFejemis(), tmp_path))
    port, front_port = robot.ports
    driver: Driver = start_driver(port, board="fejemis", front_port=front_port)
    probe: Probe = probe_of(driver)
    probe.listen(Imu, "imu/data_raw")  # each message is an occasion to look at the graph again
    expected = rules()["/omnibot/driver"]
    found: Rules = {}

    def look() -> bool:
        try:
            found.update(seen(probe.node, f"/{driver.namespace}"))
        except NodeNameNonExistentError:
            return False
        return found == expected

    assert probe.comes_about(look), (found, expected)


def test_the_others_are_allowed_what_the_driver_has_and_only_the_operator_calls() -> None:
    """Each node except the driver may use only the driver's topics, and topics that all nodes use.

    Only the operator's node may call the driver's services and publish lift commands.
    """
    every = rules()
    driver = every.pop("/omnibot/driver")
    everywhere = {"/rosout", "/parameter_events", "/clock"}
    for other in every.values():
        assert other["publish"] <= driver["subscribe"] | everywhere
        assert other["subscribe"] <= driver["publish"] | driver["subscribe"] | everywhere
        assert other["request"] <= driver["reply"]
    assert {path for path, one in every.items() if one["request"]} == {"/omnibot/operator"}
    moving = {path for path, one in every.items() if "/lift_cmd" in one["publish"]}
    assert moving == {"/omnibot/operator"}
