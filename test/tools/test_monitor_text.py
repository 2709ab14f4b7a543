# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what the monitor shows: text, numbers, the plot of the path, JSON."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from monitor_view import FINE, view

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.reporting.status import Level, Status
from omnibot_driver.tools.monitor import text
from omnibot_driver.tools.monitor.model import Flow
from omnibot_driver.tools.monitor.plot import draw_path, sparkline

anything = st.floats()
triples = st.tuples(anything, anything, anything)


@given(triples, triples, triples, triples)
def test_no_value_breaks_the_screen(
    pose: tuple[float, ...], twist: tuple[float, ...], force: Any, rate: Any
) -> None:
    """The values have NaN, infinity or 1e300.

    The monitor shows them, and every line fits its column.
    """
    shown = view(pose=Pose(*pose), measured=BodyTwist(*twist), force_mps2=force, rate_radps=rate)
    lines = text.figures(shown)
    assert max(map(len, lines)) <= 42
    assert any("nan" in line for line in lines) == any(
        math.isnan(value) for value in (*pose, *twist, *force, *rate)
    )
    draw_path([(pose[0], pose[1]), (0.0, 0.0)], 20, 10, Pose(*pose))
    json.loads(text.as_json(shown, []), parse_constant=lambda name: pytest.fail(name))


def test_json_holds_the_values() -> None:
    """The JSON has all values in SI units. Values that are not finite are null."""
    told = json.loads(text.as_json(view(force_mps2=(math.nan, 1.0, math.inf)), ["trouble"]))
    assert told["driver"] == "/robot1/omnibot_driver"
    assert (told["state"], told["estop"]) == ("nominal", False)
    assert told["rates_hz"] == {"imu/data_raw": 100.0, "odom": 25.0}
    assert told["pose"] == {"x_m": 1.5, "y_m": -0.25, "yaw_rad": 0.5}
    assert told["commanded"] == {"vx_mps": 0.25, "vy_mps": 0.0, "yaw_rate_radps": -0.125}
    assert told["imu"]["linear_acceleration_mps2"] == [None, 1.0, None]
    assert told["diagnostics"]["Link"]["values"]["Port"] == "/dev/omnibot"
    assert told["troubles"] == ["trouble"]


def test_what_is_not_known_is_a_dash_and_null() -> None:
    """A topic has no message yet. Its values are dashes on the screen and null in JSON."""
    shown = view(pose=None, measured=None, commanded=None, force_mps2=None, rate_radps=None)
    assert "–" in text.figures(shown)[3]
    told = json.loads(text.as_json(shown, []))
    assert told["pose"] is None
    assert told["imu"]["angular_velocity_radps"] is None


def test_what_needs_somebody_stands_first() -> None:
    """Errors are shown before warnings. All statuses that are OK share one line."""
    statuses = (
        *FINE,
        Status("Time", Level.STALE, "not known", {}),
        Status("Board", Level.WARN, "paused", {}),
        Status("IMU", Level.ERROR, "stuck", {}),
    )
    assert text.verdicts(view(statuses=statuses)) == [
        (Level.ERROR, "IMU: stuck"),
        (Level.WARN, "Board: paused"),
        (Level.STALE, "Time: not known"),
        (Level.OK, "OK: Link, Stream"),
    ]


def test_what_has_happened_is_counted() -> None:
    """The monitor shows how often each fault has occurred.

    It omits faults that have not occurred.
    """
    stream = Status("Stream", Level.OK, "complete", {"Framing faults": "3", "Sequence gaps": "0"})
    assert text.counts(view(statuses=(stream,))) == "since driver start: framing faults 3"
    assert text.counts(view()) == "since driver start: nothing lost, nothing refused"


def test_a_message_cannot_move_the_cursor() -> None:
    """A text from /diagnostics has control characters. The monitor replaces them by question marks.

    Otherwise the text could move the cursor.
    """
    rude = Status("Link", Level.ERROR, "\x1b[2J\nbad\x07", {"Port": "\x1b]0;owned\x07"})
    shown = view(statuses=(rude,), state="\x1b[31m")
    everything = text.report(shown).replace("\n", "") + text.title(shown)
    assert everything.isprintable()


def test_a_silent_driver_is_said_to_be_silent() -> None:
    """The driver is silent. The title shows for how long, and omits the old state of the link."""
    assert text.title(view(silent_s=7.2)).endswith("silent for 7 s (last state: nominal)")
    assert text.title(view()) == "/robot1/omnibot_driver  nominal  connected, /dev/omnibot"


def test_an_estop_is_latched_asked_for_or_not() -> None:
    """The e-stop line distinguishes latched, requested, not latched and unknown."""
    assert text.estop(view()) == "e-stop not latched"
    assert text.estop(view(estop=True)) == "E-STOP LATCHED"
    assert text.estop(view(estop_asked=True)) == "E-STOP REQUESTED, NOT YET CONFIRMED"
    for unknown in (view(estop=None), view(silent_s=3.1)):
        assert text.estop(unknown) == "e-stop: unknown"
    assert text.estop(view(estop=True, silent_s=3.1)) == "E-STOP LATCHED"


def test_the_picture_of_a_square_is_a_square() -> None:
    """The robot drives along a square. The plot shows its outline, which is as wide as high."""
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)]
    picture = draw_path(corners, 24, 12)
    assert {len(row) for row in picture.rows} == {24}
    assert " " not in picture.rows[0] + picture.rows[-1]
    assert {row[1:-1] for row in picture.rows[1:-1]} == {" " * 22}
    assert all(row[0] != " " != row[-1] for row in picture.rows)
    assert picture.width_m == pytest.approx(1.0, rel=0.03)


@pytest.mark.parametrize(
    ("yaw_rad", "arrow"),
    [(0.0, "→"), (math.pi / 2, "↑"), (math.pi, "←"), (-math.pi / 4, "↘"), (20 * math.pi, "→")],
)
def test_the_robot_points_where_it_looks(yaw_rad: float, arrow: str) -> None:
    """An arrow in the plot shows the robot's heading.

    In the plot, x is to the right and y is up.
    """
    assert any(arrow in row for row in draw_path([], 10, 5, Pose(1.0, 1.0, yaw_rad)).rows)


@given(
    st.lists(st.tuples(anything, anything), max_size=30),
    st.integers(-1, 60),
    st.integers(-1, 30),
)
def test_any_way_fits_any_picture(
    points: list[tuple[float, float]], columns: int, rows: int
) -> None:
    """The plot has exactly the requested size, but at least one row and one column."""
    picture = draw_path(points, columns, rows, Pose(*(points[-1] if points else (0.0, 0.0))))
    assert len(picture.rows) == max(1, rows)
    assert {len(row) for row in picture.rows} == {max(1, columns)}


@given(st.lists(st.integers(0, 10**6), max_size=80), st.integers(0, 70))
def test_a_sparkline_has_its_width(values: list[int], columns: int) -> None:
    """In a sparkline, zero is a blank and the largest value is a full bar.

    All other values are visible.
    """
    line = sparkline(values, columns)
    assert len(line) == columns
    shown = values[-columns:] if columns else []
    assert [char == " " for char in line[columns - len(shown) :]] == [not v for v in shown]
    assert ("▇" in line) == any(shown)


def test_a_board_without_an_imu_has_no_rows_of_it() -> None:
    """The board has no IMU. Text and JSON omit the IMU, and do not report it as missing."""
    shown = view(lacks=frozenset({"imu"}), imu=Flow(0.0, None, ()), force_mps2=None)
    words = "\n".join(text.figures(shown))
    assert "odom" in words
    assert not [word for word in ("imu", "force", "gyro") if word in words]
    told = json.loads(text.as_json(shown, []))
    assert "imu" not in told
    assert set(told["rates_hz"]) == {"odom"}
    assert shown.missing(diagnostics=True) == []
