# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that running drivers are found by their topics."""

from types import SimpleNamespace

import pytest

from omnibot_driver.tools.drivers import discovery_advice, drivers_among, running_drivers

STRING, BOOL = "std_msgs/msg/String", "std_msgs/msg/Bool"


def test_a_driver_is_a_node_with_a_state_and_an_estop() -> None:
    """A driver is a node with the topics ``state`` and ``estop_active`` of the right types."""
    topics = [
        ("/omnibot_driver/state", STRING), ("/omnibot_driver/estop_active", BOOL),
        ("/robot1/base/estop_active", BOOL), ("/robot1/base/state", STRING),
        ("/other/state", STRING), ("/third/state", "std_msgs/msg/Int8"),
        ("/third/estop_active", BOOL), ("/state", STRING), ("/estop_active", BOOL),
    ]  # fmt: skip
    assert drivers_among(topics) == ["/omnibot_driver", "/robot1/base"]
    assert drivers_among([]) == []


def test_one_that_is_only_listened_to_does_not_run() -> None:
    """A driver does not run if its topics have only subscribers.

    The topics exist because a tool has subscribed to them, but no program publishes on them.
    """
    counts = {"/a/state": 1, "/a/estop_active": 1, "/b/state": 0, "/b/estop_active": 0}
    node = SimpleNamespace(
        get_topic_names_and_types=lambda: [
            (name, [STRING if name.endswith("state") else BOOL]) for name in counts
        ],
        count_publishers=lambda name: counts[name],
    )
    assert running_drivers(node) == ["/a"]


@pytest.mark.parametrize(
    ("environment", "advised"),
    [
        ({}, False),
        ({"ROS_DISCOVERY_SERVER": "10.0.0.1:11811"}, True),
        ({"ROS_DISCOVERY_SERVER": "10.0.0.1:11811", "ROS_SUPER_CLIENT": "FALSE"}, True),
        ({"ROS_DISCOVERY_SERVER": "10.0.0.1:11811", "ROS_SUPER_CLIENT": "TRUE"}, False),
    ],
)
def test_with_a_discovery_server_a_tool_says_that_it_must_be_a_super_client(
    environment: dict[str, str], advised: bool
) -> None:
    """A tool uses a discovery server, but not as a super client. The advice names the setting."""
    assert ("ROS_SUPER_CLIENT=TRUE" in discovery_advice(environment)) is advised
