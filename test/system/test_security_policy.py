# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that compare config/omnibot.policy.xml with SROS2's schema 0.2.0 and a running driver."""

from collections.abc import Callable
from fnmatch import fnmatch
from pathlib import Path
from typing import Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest
import rclpy
from driver_process import Driver
from probe import Probe
from rclpy.context import Context
from rclpy.node import Node, NodeNameNonExistentError
from sensor_msgs.msg import Imu

POLICY: Final = Path(__file__).parents[2] / "config" / "omnibot.policy.xml"
NODE: Final = "omnibot_driver"

CHILDREN: Final = {
    "policy": ("enclaves",),
    "enclaves": ("enclave",),
    "enclave": ("profiles",),
    "profiles": ("profile",),
    "profile": ("topics", "services", "actions"),
    "topics": ("topic",),
    "services": ("service",),
    "actions": ("action",),
}
REQUIRED: Final = {"policy": ("version",), "enclave": ("path",), "profile": ("ns", "node")}
QUALIFIERS: Final = {
    "topics": ("publish", "subscribe"),
    "services": ("reply", "request"),
    "actions": ("call", "execute"),
}
MOVES_OR_STOPS: Final = ("/cmd_vel", "/wheel_cmd", "/cmd_pose", "/estop")

Rules = dict[str, set[str]]
"""The names of topics and services that a profile allows.

The keys are the kinds of use: ``publish``, ``subscribe``, ``reply`` and ``request``.
"""


def profiles(policy: Path = POLICY) -> dict[str, Element]:
    """Return the only profile of each enclave. The keys are the paths of the enclaves."""
    enclaves = ElementTree.parse(policy).getroot().iter("enclave")
    return {enclave.attrib["path"]: next(enclave.iter("profile")) for enclave in enclaves}


def allowed(profile: Element) -> Rules:
    """Return the full names that a profile allows, as SROS2 expands them.

    A name that begins with ``~`` is relative to the node. A name that begins without a slash is
    relative to the profile's namespace.
    """
    namespace = profile.attrib["ns"].rstrip("/")
    found: Rules = {"publish": set(), "subscribe": set(), "reply": set(), "request": set()}
    for group in profile:
        for name in (item.text or "" for item in group):
            if name.startswith("~"):
                name = f"{namespace}/{profile.attrib['node']}{name[1:]}"
            elif not name.startswith("/"):
                name = f"{namespace}/{name}"
            for qualifier in group.attrib:
                found[qualifier].add(name)
    return found


def test_the_policy_keeps_to_the_schema() -> None:
    """Elements and attributes of the policy are those that the schema of SROS2 allows."""
    root = ElementTree.parse(POLICY).getroot()
    assert root.tag == "policy"
    assert root.attrib == {"version": "0.2.0"}
    for element in root.iter():
        if (children := CHILDREN.get(element.tag)) is not None:
            assert {child.tag for child in element} <= set(children), element.tag
            assert len(element) > 0, f"{element.tag} is empty"
        else:
            assert element.text, f"an empty {element.tag}"
            assert element.text == element.text.strip()
        qualifiers = QUALIFIERS.get(element.tag, ())
        required = REQUIRED.get(element.tag, ())
        assert set(required) <= set(element.attrib) <= {*required, *qualifiers}, element.tag
        given = [element.attrib[name] for name in qualifiers if name in element.attrib]
        assert bool(given) == bool(qualifiers), f"{element.tag} allows nothing"
        assert set(given) <= {"ALLOW", "DENY"}


def test_the_driver_may_do_what_it_does_and_nothing_else(
    probe_of: Callable[[Driver], Probe], driver: Driver
) -> None:
    """The policy allows exactly the topics and services that the driver has in the ROS graph."""
    probe = probe_of(driver)
    probe.listen(Imu, "imu/data_raw")  # each message is an occasion to look at the graph again
    expected = allowed(profiles()["/omnibot/driver"])
    found: Rules = {}

    def look() -> bool:
        try:
            found.update(seen(probe.node, f"/{driver.namespace}"))
        except NodeNameNonExistentError:
            return False
        return found == expected

    assert probe.comes_about(look), (found, expected)


def seen(graph: Node, home: str) -> Rules:
    """Return the topics and services that the driver uses, as the ROS graph shows them.

    The keys are the kinds of use, such as ``publish``.
    """

    def names(found: list[tuple[str, list[str]]]) -> set[str]:
        return {name.removeprefix(home) for name, _ in found}

    subscribed = names(graph.get_subscriber_names_and_types_by_node(NODE, home))
    published = names(graph.get_publisher_names_and_types_by_node(NODE, home))
    return {
        "publish": published | {"/tf"},  # where tf2_ros is installed
        "subscribe": subscribed | {"/clock"},  # with use_sim_time
        "reply": names(graph.get_service_names_and_types_by_node(NODE, home)),
        "request": set(),
    }


@pytest.mark.parametrize("enclave", sorted(set(profiles()) - {"/omnibot/driver"}))
def test_the_others_are_allowed_nothing_that_the_driver_does_not_have(enclave: str) -> None:
    """The policy lets other enclaves use only the driver's topics and services, and common topics.

    Common topics are those that every node uses, such as /rosout.
    """
    driver, other = allowed(profiles()["/omnibot/driver"]), allowed(profiles()[enclave])
    everywhere = {"/rosout", "/parameter_events", "/clock"}
    assert other["publish"] <= driver["subscribe"] | everywhere
    assert other["subscribe"] <= driver["publish"] | driver["subscribe"] | everywhere
    assert other["request"] <= driver["reply"]


@pytest.mark.parametrize("file", ["omnibot", "fejemis"])
def test_operators_and_observers_may_read_all_commands(file: str) -> None:
    """Tools and recorders also subscribe to the topics that command the robot.

    Regression: under SROS2, monitor, calibrate and `report --live` failed when they subscribed to
    cmd_vel.
    """
    every = profiles(POLICY.with_name(f"{file}.policy.xml"))
    driver = allowed(every["/omnibot/driver"])
    for path in ("/omnibot/operator", "/omnibot/observer"):
        assert allowed(every[path])["subscribe"] >= driver["subscribe"] | driver["publish"]


@pytest.mark.parametrize("file", ["omnibot", "fejemis"])
def test_a_node_of_each_enclave_may_answer_its_own_services_only(file: str) -> None:
    """A node of each enclave may offer the services that every rclpy node has.

    Except for the driver and the operator, it may offer services only under its own name, so it
    cannot answer in the driver's name.
    """
    for path, profile in profiles(POLICY.with_name(f"{file}.policy.xml")).items():
        name = "monitor_1" if path == "/omnibot/operator" else profile.attrib["node"]
        context = Context()
        rclpy.init(args=[], context=context)
        try:
            node = Node(name, context=context)
            rules = allowed(profile)
            # Under SROS2, a node cannot start if the policy does not allow these services.
            for service in node.services:
                assert any(fnmatch(service.service_name, one) for one in rules["reply"]), path
            assert {publisher.topic_name for publisher in node.publishers} <= rules["publish"]
            node.destroy_node()
        finally:
            rclpy.shutdown(context=context)
        if path not in ("/omnibot/driver", "/omnibot/operator"):
            assert rules["reply"] == {f"/{name}/*"}


def test_only_named_enclaves_may_move_stop_or_release_the_robot() -> None:
    """Only the expected enclaves are allowed to publish commands.

    Only the operator's enclave is allowed to call services.
    """
    rules = {path: allowed(profile) for path, profile in profiles().items()}
    who = {
        name: {path for path, rule in rules.items() if name in rule["publish"]}
        for name in MOVES_OR_STOPS
    }
    assert who == {
        "/cmd_vel": {"/omnibot/operator", "/omnibot/navigation"},
        "/wheel_cmd": {"/omnibot/operator"},
        "/cmd_pose": {"/omnibot/operator", "/omnibot/navigation"},
        "/estop": {"/omnibot/operator", "/omnibot/navigation", "/omnibot/estop_button"},
    }
    callers = {path for path, rule in rules.items() if rule["request"]}
    assert callers == {"/omnibot/operator"}
