# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the monitor's model of the robot: rates, latest values and path."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from monitor_view import FINE, view

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.reporting.status import Level
from omnibot_driver.tools.monitor.model import LONGEST_PATH, Flow, Model, level
from omnibot_driver.tools.monitor.rates import HISTORY_S, WINDOW_S, Rate

HALT = BodyTwist(0.0, 0.0, 0.0)
NOTHING = Flow(0.0, None, ())
waits_s = st.lists(st.floats(0.0, 3.0), max_size=300)


@given(st.floats(0.5, 120.0), st.floats(2.0, 30.0), st.floats(0.0, 1e6))
def test_a_steady_stream_has_its_own_rate(hz: float, seconds: float, began_s: float) -> None:
    """Messages arrive at a constant rate.

    The measured rate differs from the true one by at most one message in the measuring time.
    """
    rate = Rate(began_s)
    for number in range(math.ceil(seconds * hz)):
        rate.arrived(began_s + number / hz)
    assert rate.hz(began_s + seconds) == pytest.approx(hz, abs=1.01 / WINDOW_S)


@given(waits_s)
def test_no_arrival_is_lost_or_made_up(waits: list[float]) -> None:
    """The history has the number of messages in each second of the last minute.

    Each message is counted exactly once.
    """
    rate, arrivals, now_s = Rate(0.0), [], 0.0
    for wait_s in waits:
        now_s += wait_s
        rate.arrived(now_s)
        arrivals.append(now_s)
    first, end = max(0, int(now_s) - HISTORY_S), int(now_s)
    expected = [sum(int(at) == second for at in arrivals) for second in range(first, end)]
    assert list(rate.history(now_s)) == expected
    assert rate.count == len(arrivals)
    recent = sum(now_s - at < WINDOW_S for at in arrivals)
    assert rate.hz(now_s) == (recent / min(WINDOW_S, now_s) if now_s else 0.0)


@given(waits_s, st.floats(WINDOW_S + 0.01, 1e4))
def test_what_has_ceased_has_no_rate(waits: list[float], silence_s: float) -> None:
    """No more messages arrive. After the measuring time, the rate is 0.

    The history continues with zeros.
    """
    rate, now_s = Rate(0.0), 0.0
    for wait_s in waits:
        now_s += wait_s
        rate.arrived(now_s)
    now_s += silence_s
    assert rate.hz(now_s) == 0.0
    assert rate.age_s(now_s) is None
    assert rate.history(now_s)[-1:] in ((), (0,))
    assert len(rate.history(now_s)) == min(HISTORY_S, int(now_s))


def test_the_way_is_kept_in_steps() -> None:
    """A moving robot adds a point to the path every 2 cm. A robot at rest adds nothing."""
    model = Model("/omnibot_driver", 0.0)
    for tick in range(1000):
        model.odom(Pose(min(tick, 500) * 0.001, 0.0), HALT, tick * 0.04)
    path = model.view(40.0).path
    assert path[0] == (0.0, 0.0)
    assert len(path) == pytest.approx(26, abs=1)


def test_the_way_is_bounded() -> None:
    """The robot drives for hours. The number of points in its path stays limited."""
    model = Model("/omnibot_driver", 0.0)
    for tick in range(2 * LONGEST_PATH):
        model.odom(Pose(0.03 * tick, 0.0), HALT, 0.04 * tick)
    assert len(model.view(0.0).path) == LONGEST_PATH


def test_a_reset_of_the_odometry_begins_a_new_way() -> None:
    """The pose jumps farther than the robot can move.

    The model takes this for a reset of the odometry, and begins a new path.
    """
    model = Model("/omnibot_driver", 0.0)
    model.odom(Pose(2.0, 0.0), HALT, 1.0)
    model.odom(Pose(0.0, 0.0), HALT, 1.04)
    assert model.view(1.1).path == ((0.0, 0.0),)


def test_a_pose_that_is_none_is_shown_but_not_followed() -> None:
    """A pose has NaN or infinity.

    The view shows this pose and names the values that are not finite. The path omits the pose.
    """
    model = Model("/omnibot_driver", 0.0)
    for number, x_m in enumerate((0.0, math.nan, math.inf, 0.1)):
        model.odom(Pose(x_m, 0.0), BodyTwist(x_m, 0.0, 0.0), 0.1 * number)
        strange = [] if math.isfinite(x_m) else ["pose x", "measured x"]
        assert model.view(0.1 * number).not_finite() == strange
    assert model.view(1.0).path == ((0.0, 0.0), (0.1, 0.0))


def test_a_command_that_nobody_repeats_is_none() -> None:
    """A command is older than 0.5 s, so it no longer moves the robot. The view does not show it."""
    model = Model("/omnibot_driver", 0.0)
    model.commanded(BodyTwist(0.1, 0.0, 0.0), 1.0)
    assert model.view(1.4).commanded == BodyTwist(0.1, 0.0, 0.0)
    assert model.view(1.6).commanded is None


def test_commands_do_not_make_a_silent_driver_look_alive() -> None:
    """The driver is silent while another node sends commands.

    The view still shows the driver as silent.
    """
    model = Model("/omnibot_driver", 0.0)
    model.state("nominal", 1.0)
    model.commanded(HALT, 9.0)
    assert model.view(10.0).silent_s == 9.0


def test_what_was_measured_once_is_not_what_is_measured() -> None:
    """The last messages are old. The view omits velocities, IMU data and diagnostics.

    It keeps the last pose.
    """
    model = Model("/omnibot_driver", 0.0)
    model.odom(Pose(1.0, 0.0), BodyTwist(0.2, 0.0, 0.0), 1.0)
    model.imu((0.0, 0.0, 9.8), (0.0, 0.0, 0.0), 1.0)
    model.diagnosed(FINE, 1.0)
    seen, later = model.view(1.5), model.view(5.0)
    assert seen.measured
    assert (seen.force_mps2, seen.statuses) == ((0.0, 0.0, 9.8), FINE)
    assert (later.measured, later.force_mps2, later.rate_radps) == (None, None, None)
    assert later.statuses == ()
    assert later.pose == Pose(1.0, 0.0)


@pytest.mark.parametrize(
    ("state", "missing"),
    [
        ("nominal", ["imu/data_raw", "odom"]),
        ("imu_only", ["imu/data_raw"]),
        ("paused", []),
        ("disconnected", []),
    ],
)
def test_a_topic_is_missing_where_the_state_promises_it(state: str, missing: list[str]) -> None:
    """The view reports a silent topic as missing only if data are expected in the driver's state.

    ``state``: the driver's state. ``missing``: the topics that are reported.
    """
    assert view(state=state, imu=NOTHING, odom=NOTHING).missing(diagnostics=True) == missing


def test_diagnostics_are_missing_where_somebody_publishes_them() -> None:
    """The view reports missing diagnostics only if diagnostics are expected.

    A driver that replays a recording publishes no diagnostics.
    """
    assert view(statuses=()).missing(diagnostics=True) == ["/diagnostics"]
    assert view(statuses=()).missing(diagnostics=False) == []


def test_a_level_that_is_none_counts_as_an_error() -> None:
    """A node publishes an unknown level on /diagnostics. The monitor shows it as an error."""
    assert [level(byte) for byte in (0, 1, 2, 3, 4, 255)] == [
        *(Level.OK, Level.WARN, Level.ERROR, Level.STALE),
        *(Level.ERROR, Level.ERROR),
    ]
