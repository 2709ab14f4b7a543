# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds robots by the names and message types of topics."""

from collections.abc import Collection, Iterable, Mapping
from typing import Final

from omnibot_driver.tools.drivers import SIGNS, drivers_among
from omnibot_driver.tools.needs import ToolError
from omnibot_driver.tools.report.recorder import DIAGNOSTICS, EVENTS, SERIES

PROOF: Final = ("imu/data_raw", "odom", "state")
"""Topics that identify a robot. A namespace with at least one of them belongs to a robot."""

Topics = dict[str, str]
"""The topics of one robot. The key is the topic's name, the value its role, such as ``odom``."""


def find(topics: Iterable[tuple[str, str]]) -> dict[str, Topics]:
    """Return the topics of each robot, by the robot's namespace ("/" if it is empty).

    ``topics``: name and message type of each topic.
    """
    pairs = set(topics)
    drivers = drivers_among(pairs)
    robots: dict[str, Topics] = {}
    for topic, kind in sorted(pairs):
        for role, (namespace, fits) in _roles(topic, kind, drivers).items():
            if fits:
                robots.setdefault(namespace, {})[topic] = role
    robots = {name: found for name, found in robots.items() if {*found.values()} & {*PROOF}}
    if (DIAGNOSTICS, EVENTS[DIAGNOSTICS]) in pairs:
        for found in robots.values():
            found[DIAGNOSTICS] = DIAGNOSTICS
    return robots


def _roles(topic: str, kind: str, drivers: Collection[str]) -> Mapping[str, tuple[str, bool]]:
    """Return each role that matches a topic's name, with the namespace and whether the topic fits.

    A topic fits a role if ``kind`` is one of the role's message types. A topic such as ``~/state``
    must also belong to a node in ``drivers``.
    """
    roles: dict[str, tuple[str, bool]] = {}
    for role, series in SERIES.items():
        if topic.endswith(f"/{role}"):
            roles[role] = (topic[: -len(role) - 1] or "/", kind in series.read)
    node, _, name = topic.rpartition("/")
    if node and name in SIGNS:
        fits = kind == SIGNS[name] and node in drivers
        roles[name] = (node.rpartition("/")[0] or "/", fits)
    return roles


def choose(robots: Mapping[str, Topics], wanted: str | None, where: str) -> tuple[str, Topics]:
    """Return the namespace and the topics of one robot.

    ``wanted``: its namespace; None selects the only robot. ``where``: name of the source of the
    topics, for error messages. Raises ToolError unless exactly one robot matches.
    """
    names = ", ".join(robots)
    if not robots:
        raise ToolError(
            f"{where} has no topic of a driver (imu/data_raw, odom, omnibot_driver/state)"
        )
    if wanted is not None:
        name = "/" + wanted.strip("/")
        if name not in robots:
            raise ToolError(
                f"{where} has no robot in the namespace {name}; choose one with --namespace:"
                f" {names}"
            )
        return name, robots[name]
    if len(robots) > 1:
        raise ToolError(f"{where} has several robots; choose one with --namespace: {names}")
    return next(iter(robots.items()))
