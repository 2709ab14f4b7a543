# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a board with few features: the driver has no interfaces for what the board lacks."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from plain_board import PARAMETERS
from probe import Probe
from rcl_interfaces.msg import Parameter as RosParameter
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from omnibot_driver.tools.monitor.__main__ import main

Start = Callable[..., Any]
PLAIN: Final = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from omnibot_driver import boards
boards.PROFILES["plain"] = "plain_board"
"""
NODE: Final = "omnibot_driver"


def start_plain(start_driver: Start, port: str | None, **parameters: object) -> Driver:
    driver: Driver = start_driver(port, before=PLAIN, board="plain", **parameters)
    return driver


def names(found: list[tuple[str, list[str]]], home: str) -> set[str]:
    """Return the names without the driver's namespace, ``home``.

    Names that every ROS node has are left out.
    """
    of_ros = ("parameter", "type_description", "/rosout", "/tf")
    relative = {name.removeprefix(f"{home}/") for name, _types in found}
    return {name for name in relative if not any(word in name for word in of_ros)}


def test_what_a_board_lacks_is_not_advertised(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """The board has no IMU, no wheel commands and no pause.

    The driver has no topics, services and parameters for these.
    """
    driver = start_plain(start_driver, start_board().path)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    home, node = f"/{driver.namespace}", probe.node
    probe.wait_for_node(NODE, home)
    told = {"odom", "joint_states", "/diagnostics", "heard", f"{NODE}/state"}
    taken = {"cmd_vel", "estop"}
    served = {f"{NODE}/{service}" for service in ("start", "estop", "reset_odometry", "ask")}
    for found, all_of_them in (
        (node.get_publisher_names_and_types_by_node, told | {f"{NODE}/estop_active"}),
        (node.get_subscriber_names_and_types_by_node, taken),
        (node.get_service_names_and_types_by_node, served),
    ):
        probe.wait_for_graph(lambda: names(found(NODE, home), home) >= all_of_them)  # noqa: B023
        assert names(found(NODE, home), home) == all_of_them
    declared = set(probe.call(ListParameters, "list_parameters").result.names)
    assert set(PARAMETERS.by_name) <= declared
    assert not {name for name in declared if "imu" in name or "gyro" in name or "accel_" in name}
    assert not {"max_wheel_speed", "linear_scale", "control_method"} & declared
    (gain,) = probe.call(GetParameters, "get_parameters", names=["gain"]).values
    assert gain.type == ParameterType.PARAMETER_NOT_SET
    given = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=2.0)
    request = [RosParameter(name="gain", value=given)]
    assert probe.call(SetParameters, "set_parameters", parameters=request).results[0].successful
    (gain,) = probe.call(GetParameters, "get_parameters", names=["gain"]).values
    assert gain.double_value == 2.0


def test_a_deleted_parameter_does_not_block_the_others(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A user asks to delete an optional parameter. The driver refuses.

    If the parameter were deleted, every later change would fail, because a change reads all
    parameters.
    """
    probe: Probe = probe_of(start_plain(start_driver, start_board().path))
    deleted = [RosParameter(name="gain", value=ParameterValue())]
    (result,) = probe.call(SetParameters, "set_parameters", parameters=deleted).results
    assert not result.successful
    assert "'gain' cannot be deleted" in result.reason
    slow = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=0.1)
    request = [RosParameter(name="max_linear_speed", value=slow)]
    assert probe.call(SetParameters, "set_parameters", parameters=request).results[0].successful


def test_what_it_has_works(start_board: Start, start_driver: Start, probe_of: Start) -> None:
    """A board with few features obeys cmd_vel. Its own service, ``ask``, answers.

    joint_states has the board's two wheels. /diagnostics has no figures of an IMU.
    """
    board = start_board()
    probe: Probe = probe_of(start_plain(start_driver, board.path, track_width=0.4))
    joints, odometry = probe.listen(JointState, "joint_states"), probe.listen(Odometry, "odom")
    diagnoses = probe.listen(DiagnosticArray, "/diagnostics")
    probe.wait_for_state("nominal")
    probe.wait_for(lambda: joints and odometry)
    assert joints[-1].name == ["left_wheel_joint", "right_wheel_joint"]
    twist = Twist()
    twist.linear.x = 0.1
    probe.publisher(Twist, "cmd_vel").publish(twist)
    assert board.wait_for(lambda b: (7, 0, 0) in [c.values for c in b.commands], PATIENCE_S)
    assert probe.call(Trigger, "ask").message == "nominal"
    probe.wait_for(
        lambda: {f"{NODE}: Stream"} <= {status.name for one in diagnoses for status in one.status}
    )
    (stream, *_) = [s for one in diagnoses for s in one.status if s.name == f"{NODE}: Stream"]
    told = {pair.key for pair in stream.values}
    assert {"Odometry rate (Hz)", "Odometry frames lost"} <= told
    assert not {key for key in told if "IMU" in key}


def test_the_monitor_shows_what_the_board_has(
    start_board: Start,
    start_driver: Start,
    probe_of: Start,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The board has no IMU. The monitor neither shows an IMU nor reports it as missing."""
    driver = start_plain(start_driver, start_board().path)
    probe_of(driver).wait_for_state("nominal")
    assert main(["--json", "--namespace", driver.namespace]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["state"], told["troubles"]) == ("nominal", [])
    assert "imu" not in told
    assert set(told["rates_hz"]) == {"odom"}
    assert "IMU" not in told["diagnostics"]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"delta_frame": "earth"},
            "'delta_frame' belongs to board omnibot, not to plain; remove it",
        ),
        (
            {"gyro_bias": "[0.0,0.0,0.0]"},
            "'gyro_bias' belongs to board omnibot or fejemis, not to plain; remove it, or set",
        ),
        ({"track_widt": 0.3}, "no parameter 'track_widt'; the nearest is 'track_width'"),
        ({"gain": 10.0}, "'gain' must be 0 to 9 1, not 10.0"),
        ({"on_exit": "pause"}, "'on_exit' must be one of stop, not 'pause'"),
        ({"names": "[a,b,c,d]"}, "'names' must be 0 to 3 strings, not"),
    ],
)
def test_what_means_nothing_to_the_board_is_refused(
    start_driver: Start, parameters: dict[str, object], message: str
) -> None:
    """The driver does not start with a wrong parameter name or value, and says what it expects."""
    driver = start_plain(start_driver, "/dev/null", **parameters)
    driver.wait_for_line(message)
    assert driver.end() == 2


def test_a_board_that_is_not_there_ends_the_start(start_driver: Start) -> None:
    """The parameter ``board`` names an unknown board.

    The driver lists the known boards and exits with code 2.
    """
    driver: Driver = start_driver("/dev/null", board="martha")
    driver.wait_for_line("cannot start: parameter 'board' must be one of omnibot")
    assert driver.end() == 2
