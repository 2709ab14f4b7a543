"""Odometry: displacements from a made-up board, and from the simulated one.

``Trip`` is a board by itself: it turns body twists into what the manual's firmware sends, written
with rotation matrices and independent of the code under test.
"""

import math
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import axis_signs, displacements, headings, small_moves

from omnibot_driver.core.board import DisplacementReading, PoseReading
from omnibot_driver.core.odometry import Odometry, OdometryEstimate, OdometrySettings
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.se2 import Pose, roll, unroll
from omnibot_driver.core.uncertainty import Covariance, OdometryNoise
from omnibot_driver.simulator import BoardPose, BoardSettings, SimulatedBoard

PERIOD_S = 0.04
SETTINGS = OdometrySettings()
Triple = tuple[float, float, float]


def xyyaw(pose: Pose) -> Triple:
    return pose.x_m, pose.y_m, pose.yaw_rad


def close(values: Triple, tolerance: float = 1e-9) -> object:
    return pytest.approx(values, abs=tolerance, rel=1e-9)


def arc(vx: float, vy: float, turn: float) -> tuple[float, float]:
    """Where a constant twist leads, by the textbook's integral of the rotation matrix."""
    if abs(turn) < 1e-6:
        return vx - vy * turn / 2, vy + vx * turn / 2
    a, b = math.sin(turn) / turn, (1 - math.cos(turn)) / turn
    return a * vx - b * vy, b * vx + a * vy


class Trip:
    """A board that has the given pose already, sends earth deltas, and whose axes have signs."""

    def __init__(self, heading: float = 0.0, signs: tuple[int, int, int] = (1, 1, 1)) -> None:
        self.board = (12.0, -34.0, heading)
        self.truth = (0.0, 0.0, 0.0)
        self._signs = signs

    def move(self, dx: float, dy: float, turn: float, frame: str = "earth") -> DisplacementReading:
        """One period of constant twist in the true body's axes; what the board makes of it."""
        self.truth = self._moved(self.truth, dx, dy, turn)
        x, y, yaw = self._signs
        before = self.board
        self.board = self._moved(before, x * dx, y * dy, yaw * turn)
        if frame == "body":
            return DisplacementReading(x * dx, y * dy, yaw * turn, "body", PERIOD_S, 0)
        return DisplacementReading(
            self.board[0] - before[0], self.board[1] - before[1], yaw * turn, "earth", PERIOD_S, 0
        )

    @property
    def pose(self) -> PoseReading:
        """The board's own."""
        return PoseReading(*self.board)

    @staticmethod
    def _moved(pose: Triple, dx: float, dy: float, turn: float) -> Triple:
        x, y, yaw = pose
        ahead, left = arc(dx, dy, turn)
        c, s = math.cos(yaw), math.sin(yaw)
        return x + c * ahead - s * left, y + s * ahead + c * left, yaw + turn


def earth(dx: float, dy: float, turn: float = 0.0) -> DisplacementReading:
    return DisplacementReading(dx, dy, turn, "earth", PERIOD_S, 0)


def body(dx: float, dy: float, turn: float = 0.0) -> DisplacementReading:
    return DisplacementReading(dx, dy, turn, "body", PERIOD_S, 0)


def heading(yaw: float) -> PoseReading:
    return PoseReading(1.0, 2.0, yaw)


def attach(odometry: Odometry, pose: PoseReading) -> list[OdometryEstimate]:
    """The board says twice where it is."""
    assert odometry.settle(pose) == []
    return odometry.settle(pose)


def last(estimates: list[OdometryEstimate]) -> Triple:
    return xyyaw(estimates[-1].pose)


# SE(2)


@given(small_moves)
def test_roll_is_the_integral_of_a_constant_twist(tangent: Pose) -> None:
    """As in the textbook."""
    chord = roll(tangent)
    expected = arc(tangent.x_m, tangent.y_m, tangent.yaw_rad)
    assert (chord.x_m, chord.y_m) == pytest.approx(expected, abs=1e-9)
    assert chord.yaw_rad == tangent.yaw_rad


@given(st.builds(Pose, st.floats(-10, 10), st.floats(-10, 10), st.floats(-3.2767, 3.2767)))
def test_unroll_and_roll_are_inverse(displacement: Pose) -> None:
    """For every turn that a delta frame can hold."""
    assert xyyaw(roll(unroll(displacement))) == close(xyyaw(displacement))
    assert xyyaw(unroll(roll(displacement))) == close(xyyaw(displacement))


@pytest.mark.parametrize("turn", [0.0, 5e-324, 1e-300, -1e-300, 1e-9, -1e-9])
def test_a_turn_of_almost_nothing_is_no_trouble(turn: float) -> None:
    """No division by zero, no loss of digits."""
    assert xyyaw(roll(Pose(0.1, 0.2, turn))) == close((0.1, 0.2, turn), 1e-9)
    assert xyyaw(unroll(Pose(0.1, 0.2, turn))) == close((0.1, 0.2, turn), 1e-9)


# Ways


def test_straight_ahead_is_x() -> None:
    """A second of 0.5 m/s."""
    odometry = Odometry(SETTINGS)
    for _ in range(25):
        estimates = odometry.displace(body(0.02, 0.0), 0.0)
    assert last(estimates) == close((0.5, 0.0, 0.0))


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_quarter_circle_to_the_left_ends_at_its_radius(frame: str) -> None:
    """Radius 1 m in 50 steps, exactly."""
    odometry, trip = Odometry(SETTINGS), Trip()
    attach(odometry, trip.pose)
    step = math.pi / 2 / 50
    for _ in range(50):
        estimates = odometry.displace(trip.move(step, 0.0, step, frame), 0.0)
    assert last(estimates) == close((1.0, 1.0, math.pi / 2))


def test_a_spin_stays_in_place_and_counts_its_turns() -> None:
    """Yaw is unwrapped."""
    odometry = Odometry(SETTINGS)
    for _ in range(100):
        estimates = odometry.displace(body(0.0, 0.0, 0.2), 0.0)
    assert last(estimates) == close((0.0, 0.0, 20.0))


@given(st.lists(small_moves, min_size=1, max_size=40), headings, axis_signs)
@settings(max_examples=200)
def test_the_way_is_the_true_one_whatever_the_boards_heading_and_axes(
    moves: list[Pose], initial: float, signs: tuple[int, int, int]
) -> None:
    """A board that has driven before, or whose axes point elsewhere, gives the same odometry."""
    odometry, trip = Odometry(SETTINGS, signs), Trip(initial, signs)
    attach(odometry, trip.pose)
    for number, move in enumerate(moves):
        estimates = odometry.displace(trip.move(*xyyaw(move)), 0.0)
        if number % 5 == 4:
            odometry.settle(trip.pose)
    assert last(estimates) == close(trip.truth, 1e-8)


@given(st.lists(small_moves, min_size=1, max_size=40), axis_signs)
def test_body_deltas_need_no_pose(moves: list[Pose], signs: tuple[int, int, int]) -> None:
    """Each comes out at once, along the true way."""
    odometry, trip = Odometry(SETTINGS, signs), Trip(1.0, signs)
    for move in moves:
        estimates = odometry.displace(trip.move(*xyyaw(move), "body"), 0.0)
        assert len(estimates) == 1
    assert last(estimates) == close(trip.truth, 1e-8)
    assert not odometry.heading_assumed


@given(small_moves, headings, st.sampled_from(["earth", "body"]))
def test_the_twist_is_the_bodys_over_40_ms(move: Pose, initial: float, frame: str) -> None:
    """Of a constant twist exactly, in the body's axes, whatever came before."""
    odometry, trip = Odometry(SETTINGS), Trip(initial)
    attach(odometry, trip.pose)
    for _ in range(3):
        (estimate,) = odometry.displace(trip.move(*xyyaw(move), frame), 0.0)
        twist = estimate.twist
        assert (twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps) == close(
            (move.x_m / 0.04, move.y_m / 0.04, move.yaw_rad / 0.04), 1e-7
        )


def test_every_delta_gives_one_estimate_with_its_own_stamp() -> None:
    """In order."""
    odometry = Odometry(SETTINGS)
    assert odometry.displace(earth(0.01, 0.0), 1.0) == []
    assert odometry.displace(earth(0.01, 0.0), 1.04) == []
    stamps = [estimate.stamp_s for estimate in attach(odometry, heading(0.0))]
    stamps += [estimate.stamp_s for estimate in odometry.displace(earth(0.01, 0.0), 1.08)]
    assert stamps == [1.0, 1.04, 1.08]


# Heading


@given(st.lists(small_moves, min_size=1, max_size=5), headings)
def test_deltas_before_the_first_pose_wait_for_it(moves: list[Pose], initial: float) -> None:
    """And come out with it, turned as if it had come before them."""
    odometry, trip = Odometry(SETTINGS), Trip(initial)
    for move in moves:
        assert odometry.displace(trip.move(*xyyaw(move)), 0.0) == []
    estimates = attach(odometry, trip.pose)
    assert len(estimates) == len(moves)
    assert last(estimates) == close(trip.truth, 1e-8)
    assert not odometry.heading_assumed


def test_the_first_pose_must_be_confirmed_too() -> None:
    """A damaged one turns nothing: the first two that agree tell the heading."""
    odometry = Odometry(SETTINGS)
    assert odometry.displace(earth(0.0, 0.1), 0.0) == []
    assert odometry.settle(heading(-1.0)) == []
    assert odometry.displace(earth(0.0, 0.1), 0.0) == []
    assert odometry.settle(PoseReading(1.0, 2.1, math.pi / 2)) == []
    assert odometry.displace(earth(0.0, 0.1), 0.0) == []
    estimates = odometry.settle(PoseReading(1.0, 2.2, math.pi / 2))
    assert len(estimates) == 3
    assert last(estimates) == close((0.3, 0.0, 0.0))
    assert odometry.refused_poses == 1


def test_a_single_pose_in_the_first_second_is_better_than_none() -> None:
    """The next one was lost; after a second it is taken for true."""
    odometry = Odometry(SETTINGS)
    odometry.settle(heading(math.pi / 2))
    for _ in range(25):
        estimates = odometry.displace(earth(0.0, 0.01), 0.0)
    assert last(estimates) == close((0.25, 0.0, 0.0))
    assert not odometry.heading_assumed


def test_without_a_pose_heading_0_is_assumed_after_a_second_of_deltas() -> None:
    """25 deltas come out together, later ones at once."""
    odometry = Odometry(SETTINGS)
    for _ in range(24):
        assert odometry.displace(earth(0.01, 0.0), 0.0) == []
    assert not odometry.heading_assumed
    estimates = odometry.displace(earth(0.01, 0.0), 0.0)
    assert odometry.heading_assumed
    assert len(estimates) == 25
    assert last(estimates) == close((0.25, 0.0, 0.0))
    assert last(odometry.displace(earth(0.0, 0.01), 0.0)) == close((0.25, 0.01, 0.0))


def test_a_pose_that_comes_after_all_is_believed_when_confirmed() -> None:
    """What was driven on the assumption stays; what follows is right."""
    odometry = Odometry(SETTINGS)
    for _ in range(25):
        odometry.displace(earth(0.0, 0.0), 0.0)
    attach(odometry, heading(math.pi / 2))
    odometry.settle(heading(math.pi / 2))
    assert last(odometry.displace(earth(0.0, 0.1), 0.0)) == close((0.1, 0.0, 0.0))


@given(st.floats(0.15, 6.1), headings)
def test_a_surprising_pose_must_be_confirmed(surprise: float, initial: float) -> None:
    """One damaged pose does not turn the odometry; two that agree tell of another earth frame."""
    odometry, trip = Odometry(SETTINGS), Trip(initial)
    attach(odometry, trip.pose)
    x, y, yaw = trip.board
    odometry.settle(PoseReading(x, y, yaw + surprise))
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.1, 0.0, 0.0))
    odometry.settle(trip.pose)
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.2, 0.0, 0.0))
    trip.board = (500.0, 600.0, initial + surprise)
    odometry.settle(trip.pose)
    odometry.settle(trip.pose)
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.3, 0.0, 0.0))


def test_two_surprising_poses_that_disagree_confirm_nothing() -> None:
    """Each is damaged in its own way."""
    odometry = Odometry(SETTINGS)
    attach(odometry, heading(0.0))
    for yaw in (1.0, 2.0, -1.0):
        odometry.settle(heading(yaw))
    assert last(odometry.displace(earth(1.0, 0.0), 0.0)) == close((1.0, 0.0, 0.0))


def test_a_board_that_counts_its_heading_modulo_a_turn_surprises_nobody() -> None:
    """From +π to −π is no jump."""
    odometry = Odometry(SETTINGS)
    attach(odometry, heading(math.pi - 0.01))
    odometry.displace(earth(0.0, 0.0, 0.02), 0.0)
    odometry.settle(heading(-math.pi + 0.01))
    ahead = earth(math.cos(-math.pi + 0.01), math.sin(-math.pi + 0.01))
    assert last(odometry.displace(ahead, 0.0)) == close((math.cos(0.02), math.sin(0.02), 0.02))


def test_small_errors_of_the_summed_displacements_are_corrected_by_each_pose() -> None:
    """The pose counts, not the sum of rounded displacements; five steps take it over."""
    odometry = Odometry(SETTINGS)
    attach(odometry, PoseReading(0.0, 0.0, 0.0))
    odometry.settle(PoseReading(0.01, -0.005, 0.02))
    ways = [last(odometry.displace(earth(0.0, 0.0), 0.0)) for _ in range(5)]
    assert ways[0] == close((0.002, -0.001, 0.004))
    assert ways[4] == close((0.01, -0.005, 0.02))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_pose_that_is_not_finite_is_ignored(bad: float) -> None:
    """Before the first good one, and after it."""
    odometry = Odometry(SETTINGS)
    odometry.displace(earth(0.0, 0.1), 0.0)
    assert odometry.settle(PoseReading(0.0, 0.0, bad)) == []
    assert len(attach(odometry, heading(math.pi / 2))) == 1
    odometry.settle(PoseReading(0.0, 0.0, bad))
    odometry.settle(PoseReading(0.0, 0.0, bad))
    assert last(odometry.displace(earth(0.0, 0.1), 0.0)) == close((0.2, 0.0, 0.0))


# Attaching and resetting


@given(
    st.lists(small_moves, min_size=1, max_size=8),
    st.lists(small_moves, min_size=1, max_size=4),
    headings,
    axis_signs,
)
def test_a_board_that_restarts_goes_on_from_here(
    before: list[Pose], after: list[Pose], initial: float, signs: tuple[int, int, int]
) -> None:
    """It counts from zero; the odometry knows no seam."""
    odometry, trip = Odometry(SETTINGS, signs), Trip(initial, signs)
    attach(odometry, trip.pose)
    for move in before:
        odometry.displace(trip.move(*xyyaw(move)), 0.0)
    trip.board = (0.0, 0.0, 0.0)
    for number, move in enumerate(after):
        reading = replace(
            trip.move(*xyyaw(move)),
            duration_s=None if number == 0 else PERIOD_S,
            restarted=number == 0,
        )
        assert odometry.displace(reading, 0.0) == []
    assert last(odometry.settle(trip.pose)) == close(trip.truth, 1e-8)


def test_a_reset_puts_the_odometry_frame_where_the_robot_stands() -> None:
    """Pose and covariance; forward is forward afterwards too."""
    odometry, trip = Odometry(SETTINGS), Trip(0.7)
    attach(odometry, trip.pose)
    for _ in range(10):
        odometry.displace(trip.move(0.02, 0.01, 0.1), 0.0)
    odometry.reset()
    (estimate,) = odometry.displace(trip.move(0.0, 0.0, 0.0), 0.0)
    assert xyyaw(estimate.pose) == close((0.0, 0.0, 0.0))
    assert estimate.covariance == Covariance()
    odometry.settle(trip.pose)
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.1, 0.0, 0.0))


def test_what_was_driven_before_a_reset_does_not_move_the_pose_after_it() -> None:
    """Also where it still waited for the board's first pose."""
    odometry, trip = Odometry(SETTINGS), Trip(0.7)
    for _ in range(3):
        odometry.displace(trip.move(0.02, 0.0, 0.1), 0.0)
    odometry.reset()
    reading = trip.move(0.01, 0.0, 0.0)
    estimates = odometry.displace(reading, 0.0) + attach(odometry, trip.pose)
    assert last(estimates) == close((0.01, 0.0, 0.0))


# Covariance


def minors(c: Covariance) -> Triple:
    """The leading principal minors: all positive exactly for a positive definite matrix."""
    first = c.xx
    second = c.xx * c.yy - c.xy**2
    third = (
        c.xx * (c.yy * c.yaw_yaw - c.y_yaw**2)
        - c.xy * (c.xy * c.yaw_yaw - c.y_yaw * c.x_yaw)
        + c.x_yaw * (c.xy * c.y_yaw - c.yy * c.x_yaw)
    )
    return first, second, third


@given(st.lists(displacements("body"), max_size=60))
def test_the_covariance_is_positive_definite_and_grows(readings: list[DisplacementReading]) -> None:
    """Its volume and the variance of the yaw never shrink: nothing corrects slip."""
    odometry = Odometry(OdometrySettings(noise=OdometryNoise(wheel_scale=0.0, wheel_slip=0.0)))
    before = Covariance()
    for reading in readings:
        (estimate,) = odometry.displace(reading, 0.0)
        now = estimate.covariance
        assert min(minors(now)) > 0
        assert now.yaw_yaw >= before.yaw_yaw
        assert minors(now)[2] >= minors(before)[2] * (1 - 1e-6)
        before = now


def test_a_robot_at_rest_grows_no_less_sure() -> None:
    """No way, no slip."""
    odometry = Odometry(SETTINGS)
    for _ in range(100):
        (estimate,) = odometry.displace(body(0.0, 0.0), 0.0)
    assert estimate.covariance == Covariance()


def test_the_covariance_is_a_random_walk_over_the_way() -> None:
    """Straight ahead, A and B roll 0.87 m to a metre, whatever the step; their errors add up."""
    noise = OdometryNoise(wheel_drift=0.01, wheel_scale=0.0, wheel_slip=0.0)
    for steps in (10, 100):
        odometry = Odometry(OdometrySettings(noise=noise))
        for _ in range(steps):
            (ahead,) = odometry.displace(body(1.0 / steps, 0.0), 0.0)
        of_a_metre = 0.01**2 * math.cos(math.pi / 6) * 2
        assert ahead.covariance.xx == pytest.approx(of_a_metre / 3 + 1e-6, rel=0.01)
        assert ahead.covariance.yaw_yaw == pytest.approx(of_a_metre / (3 * 0.143) ** 2, rel=0.01)


def test_wheels_that_drift_spread_the_robots_as_the_covariance_says() -> None:
    """Sampled: 2000 robots whose wheels go wrong at random, through the manual's matrix."""
    random, deviation, n, steps = Random(1), 0.003, 2000, 25
    noise = OdometryNoise(wheel_drift=deviation, wheel_scale=0.0, wheel_slip=0.0)
    odometry = Odometry(OdometrySettings(noise=noise))
    for _ in range(steps):
        (estimate,) = odometry.displace(body(0.06, 0.04, 0.05), 0.0)
    c, radius = math.cos(math.pi / 6), 0.143
    rims = (-c * 0.06 - 0.02 - radius * 0.05, c * 0.06 - 0.02 - radius * 0.05, 0.04 - radius * 0.05)
    ends = []
    for _ in range(n):
        x, y, yaw = (random.gauss(0.0, 1e-3) for _ in range(3))
        for _ in range(steps):
            a, b, d = (rim + random.gauss(0.0, deviation * math.sqrt(abs(rim))) for rim in rims)
            dx, dy, turn = (b - a) / (2 * c), (2 * d - a - b) / 3, -(a + b + d) / (3 * radius)
            ahead, left = arc(dx, dy, turn)
            x, y = (
                x + math.cos(yaw) * ahead - math.sin(yaw) * left,
                y + math.sin(yaw) * ahead + math.cos(yaw) * left,
            )
            yaw += turn
        off = estimate.pose
        ends.append((x - off.x_m, y - off.y_m, yaw - off.yaw_rad))
    pairs = {"xx": (0, 0), "xy": (0, 1), "x_yaw": (0, 2), "yy": (1, 1), "y_yaw": (1, 2)}
    for name, (i, j) in {**pairs, "yaw_yaw": (2, 2)}.items():
        products = [end[i] * end[j] for end in ends]
        mean = sum(products) / n
        error = math.sqrt(sum((product - mean) ** 2 for product in products)) / n
        assert getattr(estimate.covariance, name) == pytest.approx(mean, abs=4 * error), name


def test_an_error_of_a_wheels_size_grows_with_the_way_and_a_way_back_undoes_it() -> None:
    """Ten metres: ten times the deviation of one, and none of it where it began."""
    noise = OdometryNoise(wheel_drift=0.0, wheel_scale=0.01, wheel_slip=0.0)
    deviations = []
    odometry = Odometry(OdometrySettings(noise=noise))
    for step in [0.02] * 500 + [-0.02] * 500:
        (estimate,) = odometry.displace(body(step, 0.0), 0.0)
        deviations.append(math.sqrt(estimate.covariance.yaw_yaw - 1e-6))
    assert deviations[499] == pytest.approx(10 * deviations[49], rel=1e-6)
    assert deviations[49] == pytest.approx(0.01 * math.sqrt(2 / 3) / 2 / 0.143, rel=0.01)
    assert deviations[999] == pytest.approx(0.0, abs=1e-7)
    assert estimate.covariance.yy < 1e-3


# Against the simulated board


def drive(board: SimulatedBoard, seed: int) -> tuple[list[OdometryEstimate], Odometry]:
    """Twelve seconds of smooth curves and a stop, through the wire."""
    settings_ = board.settings
    bot = OmniBot(OmniBotSettings(delta_frame=settings_.frame))
    odometry, estimates, random = Odometry(SETTINGS), [], Random(seed)
    phases = [random.uniform(0, math.tau) for _ in range(3)]
    for tick in range(1400):
        if tick % 5 == 0:
            t, drives = tick / 100, tick < 1200
            command = [
                drives * size * math.sin(t * speed + phase)
                for size, speed, phase in zip((30, 30, 240), (0.9, 1.3, 0.5), phases, strict=True)
            ]
            words = [round(value) & 0xFFFF for value in command]
            data = bytes.fromhex("FF FE 01") + b"".join(word.to_bytes(2, "big") for word in words)
            board.receive(data)
        for reading in bot.receive(board.step(), tick / 100):
            if isinstance(reading, DisplacementReading):
                estimates += odometry.displace(reading, tick / 100)
            elif isinstance(reading, PoseReading):
                estimates += odometry.settle(reading)
    return estimates, odometry


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize(
    "initial", [BoardPose(), BoardPose(1000.0, -500.0, 2000.0), BoardPose(0.0, 9e3, -7000.0)]
)
def test_the_odometry_is_the_truth_of_the_simulated_robot(
    frame: str, initial: BoardPose, seed: int
) -> None:
    """Metres of curves end within 5 mm and 3 mrad, also on a board that has driven before."""
    board = SimulatedBoard(
        BoardSettings(seed=seed, frame=frame, initial_pose=initial, running=True)
    )
    estimates, odometry = drive(board, seed)
    truth = board.truth
    way = sum(math.hypot(e.twist.vx_mps, e.twist.vy_mps) * PERIOD_S for e in estimates)
    assert len(estimates) == 350
    assert way > 2.0
    assert not odometry.heading_assumed
    pose = estimates[-1].pose
    assert math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m) < 0.005
    assert pose.yaw_rad == pytest.approx(truth.yaw_rad, abs=0.003)


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_the_twist_is_the_velocity_of_the_simulated_robot(frame: str) -> None:
    """Forward, left and turning at once, on a board whose heading is a quarter turn."""
    board = SimulatedBoard(
        BoardSettings(frame=frame, initial_pose=BoardPose(0.0, 0.0, 1571.0), running=True)
    )
    bot, odometry = OmniBot(OmniBotSettings(delta_frame=board.settings.frame)), Odometry(SETTINGS)
    board.receive(bytes.fromhex("FF FE 01 00 15 00 0E 00 C8"))  # 0.3 m/s, 0.2 m/s, 0.4 rad/s
    twists = []
    for tick in range(600):
        for reading in bot.receive(board.step(), tick / 100):
            if isinstance(reading, DisplacementReading):
                twists += [e.twist for e in odometry.displace(reading, 0.0)]
            elif isinstance(reading, PoseReading):
                twists += [e.twist for e in odometry.settle(reading)]
    settled = twists[-100:]
    mean = [
        sum(getattr(twist, name) for twist in settled) / 100
        for name in ("vx_mps", "vy_mps", "yaw_rate_radps")
    ]
    assert mean == pytest.approx([0.3, 0.2, 0.4], abs=0.003)
