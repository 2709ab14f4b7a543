# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Declare a board's parameters on a node: read them at start, describe them, check each change."""

import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import rclpy
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node

from omnibot_driver import boards, calibration, parameters
from omnibot_driver.core.errors import ParameterError

NOT_OURS: Final = re.compile(
    r"use_sim_time|start_type_description_service|(qos_overrides|diagnostic_updater)\..+"
)
"""Parameters that rclpy itself, or diagnostic_updater, declares for every node."""
KNOWN_TYPES: Final = frozenset(kind.value for kind in rclpy.Parameter.Type)


def declare(node: Node) -> dict[str, Any]:
    """Declare all parameters on the node, and return their values at the driver's start.

    Values in the calibration file override those of the user. Raises ParameterError for a wrong
    value.
    """
    given = {
        name: override.value
        for name, override in node._parameter_overrides.items()
        if not NOT_OURS.fullmatch(name)
    }
    values, table = boards.check_all(given), boards.table_for(given)
    if file := values["calibration_file"]:
        found = _calibration(node, calibration.locate(str(file)), table)
        values = boards.check_all({**given, **found})
    for parameter in table.rows:
        node.declare_parameter(
            parameter.name, values[parameter.name], _descriptor(parameter), ignore_override=True
        )
    node.add_pre_set_parameters_callback(partial(_typed, table))
    node.add_on_set_parameters_callback(partial(_check, node, table))
    return values


def set_each(node: Node, request: Any, response: Any) -> Any:
    """Serve rcl_interfaces/SetParameters: set each parameter that is valid.

    This function replaces rclpy's own callback, in which a value of an unknown type raises an
    exception that would end the driver.
    """
    response.results = [_set(node, [message]) for message in request.parameters]
    return response


def set_all(node: Node, request: Any, response: Any) -> Any:
    """Serve rcl_interfaces/SetParametersAtomically: set all parameters, or none of them."""
    response.result = _set(node, request.parameters)
    return response


def _set(node: Node, messages: Sequence[Any]) -> SetParametersResult:
    if not messages:  # rclpy would refuse this, and blame ``_typed``
        return SetParametersResult(successful=True)
    for message in messages:
        if message.value.type not in KNOWN_TYPES:
            reason = f"the value of parameter '{message.name}' has no type that ROS knows"
            return SetParametersResult(successful=False, reason=f"{reason}; correct the sender")
        if not node.has_parameter(message.name):
            # rclpy's own answer does not say what is wrong.
            try:
                boards.check_all({"board": node.get_parameter("board").value, message.name: None})
            except ParameterError as error:
                return SetParametersResult(successful=False, reason=str(error))
    try:
        return node.set_parameters_atomically([*map(rclpy.Parameter.from_parameter_msg, messages)])
    except ParameterNotDeclaredException as error:
        return SetParametersResult(successful=False, reason=str(error))


def updated(values: Mapping[str, Any], changed: list[rclpy.Parameter]) -> dict[str, Any]:
    """Return all parameter values after a change; ``values`` are those before the change.

    For a floating-point parameter, an integer becomes a float, because messages need this type.
    """
    table = boards.table_for(values)
    return table.check_all({**values, **_ours(changed, table)})


def _ours(changed: list[rclpy.Parameter], table: parameters.Table) -> dict[str, Any]:
    return {item.name: item.value for item in changed if item.name in table.by_name}


def _calibration(node: Node, path: Path, table: parameters.Table) -> dict[str, parameters.Value]:
    """Return the parameters that the calibration file sets, and log their names.

    A missing file causes only a warning, because the first calibration creates it.
    """
    found, names = calibration.load(path, table), calibration.names(path)
    unread = [name for name in names if name not in table.calibrated + calibration.RECORDED]
    if not names:
        node.get_logger().warning(
            f"calibration_file {path} does not exist or is empty, so nothing is loaded from it;"
            " check the path, or calibrate to create the file"
        )
    if unread:
        nearest = [
            f"{name} (the nearest known name:"
            f" {parameters.nearest(name, table.calibrated or [name])})"
            for name in unread
        ]
        node.get_logger().warning(
            f"calibration_file {path} contains names that the driver ignores: {', '.join(nearest)}"
        )
    if found:
        node.get_logger().info(f"calibration_file {path} sets {', '.join(found)}")
    return found


def _typed(
    table: parameters.Table, changed: Sequence[rclpy.Parameter]
) -> Sequence[rclpy.Parameter]:
    """Return the changed parameters, each in its declared type.

    An integer for a floating-point parameter becomes a float, because code that reads this
    parameter expects a double. A wrong value is returned unchanged; ``_check`` rejects it.
    """
    return [_in_own_type(table, item) for item in changed]


def _in_own_type(table: parameters.Table, item: rclpy.Parameter) -> rclpy.Parameter:
    if (row := table.by_name.get(item.name)) is None:
        return item
    try:
        value = row.check(item.value)
    except ParameterError:
        return item
    return item if value is None else rclpy.Parameter(item.name, value=value)


def _check(
    node: Node, table: parameters.Table, changed: list[rclpy.Parameter]
) -> SetParametersResult:
    """Return whether the changed values are valid, each by itself and together with all others."""
    for item in changed:
        if item.type_ is rclpy.Parameter.Type.NOT_SET and item.name in table.by_name:
            reason = f"parameter '{item.name}' cannot be deleted; give it another value"
            return SetParametersResult(successful=False, reason=reason)
    present = {item.name: item.value for item in node.get_parameters(list(table.by_name))}
    try:
        table.check_all({**present, **_ours(changed, table)})
    except ParameterError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)


def _descriptor(parameter: parameters.Parameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=f"{parameter.description} [{parameter.unit}]"
        if parameter.unit
        else parameter.description,
        additional_constraints=parameter.allowed,
        read_only=parameter.fixed,
        dynamic_typing=True,
    )
    if parameter.low is not None and parameter.high is not None:
        if parameter.kind is int:
            whole = IntegerRange(
                from_value=int(parameter.low), to_value=int(parameter.high), step=1
            )
            descriptor.integer_range = [whole]
        else:
            span = FloatingPointRange(from_value=parameter.low, to_value=parameter.high)
            descriptor.floating_point_range = [span]
    return descriptor
