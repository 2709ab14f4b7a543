# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the outlier filter, which rejects only readings that cannot be true."""

import math
from dataclasses import replace
from itertools import chain
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.measurement.outlier_filter import MotionLimits, OutlierFilter
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    OdometryReading,
    PausedReading,
    PoseReading,
    Reading,
)

PERIOD_S, TICK_S, G = 0.04, 0.01, 9.80665


def imu(ax: float = 0.0, ay: float = 0.0, az: float = G, *rates: float) -> ImuReading:
    wx, wy, wz = rates or (0.0, 0.0, 0.0)
    return ImuReading((ax, ay, az), (wx, wy, wz))


def ahead(dx: float = 0.01, turn: float = 0.0, lost: int = 0) -> DisplacementReading:
    return DisplacementReading(dx, 0.0, turn, "earth", PERIOD_S, lost)


def gate() -> OutlierFilter:
    return OutlierFilter(MotionLimits(), TICK_S)


def admitted(readings: list[Reading], through: OutlierFilter) -> list[list[Reading]]:
    """Pass the readings to the filter.

    For each reading, return a list of the readings that the filter releases.
    """
    return [
        [found for found, _ in through.admit(reading, number * TICK_S)]
        for number, reading in enumerate(readings)
    ]


def trembling(random: Random) -> list[float]:
    """Return the noise of an IMU at rest: three specific forces and three angular rates."""
    return [random.gauss(0.0, 0.03) for _ in range(3)] + [random.gauss(0.0, 9e-4) for _ in range(3)]


def row(count: int, leaps: dict[int, dict[int, float]], seed: int = 1) -> list[Reading]:
    """Return ``count`` noisy readings of an IMU at rest, with 1 g upward, and with ``leaps``.

    ``leaps[i][k]``: number, in m/s² or rad/s, that is added to value ``k`` of reading ``i``.
    """
    random, found = Random(seed), list[Reading]()
    for number in range(count):
        words = trembling(random)
        words[2] += G
        for word, leap in leaps.get(number, {}).items():
            words[word] += leap
        found.append(ImuReading((words[0], words[1], words[2]), (words[3], words[4], words[5])))
    return found


# The IMU


@pytest.mark.parametrize(
    ("word", "leap"), [(0, 4.903), (1, -9.807), (2, -19.613), (3, 0.545), (4, -1.09), (5, 8.7)]
)
def test_a_word_that_leaps_once_is_refused_and_the_next_reading_comes_at_once(
    word: int, leap: float
) -> None:
    """A reading with one changed high bit is rejected, and the next reading is released at once.

    The sensor has ranges of 2 g and 250 °/s.
    """
    readings, through = row(60, {50: {word: leap}}), gate()
    came = admitted(readings, through)
    assert came[50] == []
    assert came[51] == [readings[51]]
    assert list(chain(*came)) == readings[:50] + readings[51:]
    assert through.refused_imu == 1


def test_a_leap_that_lasts_is_late_by_one_reading_and_complete() -> None:
    """The filter releases all readings of a jump that lasts, as of a robot set down on a slope.

    The filter releases the first of these readings together with the second.
    """
    readings, through = row(60, {number: {0: 4.9} for number in range(50, 60)}), gate()
    came = admitted(readings, through)
    assert came[50] == []
    assert came[51] == readings[50:52]
    assert list(chain(*came)) == readings
    assert through.refused_imu == 0


def test_a_body_cannot_leap_in_its_turning_and_be_back_whatever_else_leaps() -> None:
    """In a single reading, the vertical force and the turn rates jump.

    The filter rejects the reading, because no robot changes its turn rate by this amount for one
    reading.
    """
    leaps = {2: -8.5, 3: 3.8, 4: 0.2, 5: 3.8}
    readings, through = row(60, {50: leaps}), gate()
    came = admitted(readings, through)
    assert came[50:52] == [[], [readings[51]]]
    assert through.refused_imu == 1


@pytest.mark.parametrize("across", [0.0, 0.05, -0.3])
@pytest.mark.parametrize("knock", [12.0, -7.0, 5.6, -4.2])
def test_a_knock_of_one_reading_that_is_not_a_bit_comes_out_at_once(
    knock: float, across: float
) -> None:
    """A knock changes one reading by an amount that no single wrong bit can cause.

    The filter releases this reading at once.
    """
    readings, through = row(60, {50: {1: knock, 0: knock * across}}), gate()
    assert [len(found) for found in admitted(readings, through)] == [1] * 60


def test_a_knock_beyond_the_scale_is_none_of_its_bits() -> None:
    """A knock drives the sensor to its limit, 2 g. The filter passes the reading on at once.

    A single changed bit cannot turn a reading at rest into 2 g.
    """
    readings, through = row(60, {}), gate()
    readings[50] = imu(0.0, 0.0, 2 * G)
    assert [len(found) for found in admitted(readings, through)] == [1] * 60


@pytest.mark.parametrize(("scale_g", "leap"), [(4, 19.613), (16, 4.903), (16, 78.45)])
def test_a_bit_is_worth_more_where_the_scale_is_larger(scale_g: int, leap: float) -> None:
    """A reading that jumps by a high bit is rejected, whatever the scale of the sensor is.

    The value of a bit in m/s² depends on this scale (``full_scale_mps2``).
    """
    through = OutlierFilter(MotionLimits(full_scale_mps2=scale_g * G), TICK_S)
    came = admitted(row(60, {50: {1: leap}}), through)
    assert came[50] == []
    assert through.refused_imu == 1


@pytest.mark.parametrize("ring", [[15, -12, 9, -6, 3], [15, 14, -9, 5], [8, 15, 20, 3], [15, 5]])
def test_a_shock_that_rings_in_one_axis_is_delivered_whole(ring: list[float]) -> None:
    """A shock rings in one axis for several readings. The filter rejects none of them."""
    readings = row(60, {40 + number: {1: value} for number, value in enumerate(ring)})
    through = gate()
    assert list(chain(*admitted(readings, through))) == readings
    assert through.refused_imu == 0


@pytest.mark.slow
@pytest.mark.parametrize("g_rms", [0.003, 0.02, 0.1, 0.5])
def test_a_robot_that_shakes_loses_nothing(g_rms: float) -> None:
    """The robot shakes at random for a minute. No reading is rejected."""
    random, through = Random(1), gate()
    for number in range(6_000):
        force = [random.gauss(0.0, g_rms * G) for _ in range(3)]
        rate = [random.gauss(0.0, 0.2 * g_rms) for _ in range(3)]
        through.admit(imu(force[0], force[1], force[2] + G, *rate), number * TICK_S)
    assert through.refused_imu == 0


# Displacements


@pytest.mark.parametrize(
    "fast", [ahead(0.081), ahead(-3.2), ahead(0.0, 0.33), ahead(math.nan), ahead(0.0, -3.2)]
)
def test_a_displacement_that_is_too_fast_counts_as_lost(fast: DisplacementReading) -> None:
    """A displacement faster than 2 m/s or 8 rad/s is rejected, and counts as lost.

    The next displacement's ``lost`` also includes the ``lost`` of the rejected one.
    """
    through = gate()
    came = admitted([ahead(), replace(fast, lost=2), ahead(lost=1), ahead()], through)
    assert came == [[ahead()], [], [ahead(lost=4)], [ahead()]]
    assert through.refused_displacements == 1


def test_a_pose_tells_first_of_what_was_refused_before_it() -> None:
    """A displacement is rejected, so it counts as lost. The pose that comes next reports this loss.

    So the displacement after the pose does not report it again.
    """
    pose = PoseReading(0.0, 0.0, 0.0)
    came = admitted([ahead(), ahead(1.0), pose, ahead()], gate())
    assert came == [[ahead()], [], [replace(pose, lost=1)], [ahead()]]


def test_a_displacement_that_leaps_and_is_back_is_refused() -> None:
    """A single displacement jumps from 0.25 m/s to 1.5 m/s, and is rejected.

    A pose follows. The filter releases the pose when the next displacement shows that the jump is
    over.
    """
    pose, through = PoseReading(0.0, 0.0, 0.0), gate()
    came = admitted([*[ahead()] * 3, ahead(0.06), pose, ahead(0.011), ahead()], through)
    assert came[3:] == [[], [], [replace(pose, lost=1), ahead(0.011)], [ahead()]]
    assert through.refused_displacements == 1


def test_a_displacement_that_leaps_and_stays_there_is_late_and_complete() -> None:
    """After slow displacements come a fast one, a pose, and another fast displacement.

    The filter holds the first fast displacement and the pose until the second confirms the speed.
    """
    pose, through = PoseReading(0.0, 0.0, 0.0), gate()
    came = admitted([*[ahead()] * 3, ahead(0.06), pose, ahead(0.05), ahead(0.05)], through)
    assert came[3:] == [[], [], [ahead(0.06), pose, ahead(0.05)], [ahead(0.05)]]
    assert through.refused_displacements == 0


@pytest.mark.parametrize("longer", [1.05, 1.5, 2.0, 3.0])
def test_a_steady_motion_over_a_longer_time_is_delivered_at_once(longer: float) -> None:
    """A robot drives steadily, and one displacement has up to three times the usual duration.

    The filter releases this displacement at once, and does not take it for a spike.
    """
    steady = DisplacementReading(0.02, 0.0, 0.04, "body", 0.02, 0)
    both = longer * steady.dx_m, longer * steady.dyaw_rad
    late = replace(steady, dx_m=both[0], dyaw_rad=both[1], duration_s=longer * 0.02)
    given: list[Reading] = [*[steady] * 5, late, *[steady] * 5]
    assert admitted(given, gate()) == [[reading] for reading in given]


def test_poses_do_not_wait_for_a_displacement_that_never_comes() -> None:
    """When ten poses wait behind a displacement that has jumped, the filter releases everything."""
    pose, through = PoseReading(0.0, 0.0, 0.0), gate()
    came = admitted([*[ahead()] * 3, ahead(0.06), *[pose] * 12, ahead(0.01)], through)
    assert came[3:14] == [[]] * 10 + [[ahead(0.06), *[pose] * 10]]
    assert came[14:] == [[pose], [pose], [ahead(0.01)]]


def test_what_a_refused_displacement_told_of_the_board_is_not_forgotten() -> None:
    """A rejected displacement reports a restart of the board, and has an unknown duration.

    The next displacement then reports the restart, and has an unknown duration, too.
    """
    first = replace(ahead(9.0), duration_s=None, restarted=True)
    came = admitted([ahead(), first, ahead(), ahead()], gate())
    assert came[2:] == [[replace(ahead(), duration_s=None, restarted=True)], [ahead()]]


def test_all_motion_of_a_pause_may_be_in_one_displacement() -> None:
    """The first displacement after a pause may contain all motion of the pause.

    The filter accepts this displacement if the robot can drive so far in this time.
    """
    through = gate()
    through.admit(ahead(), 1.0)
    rolled_out = replace(ahead(0.5), duration_s=None)
    assert [found for found, _ in through.admit(rolled_out, 2.0)] == [rolled_out]
    assert through.admit(rolled_out, 2.1) == []


# All readings

values = st.floats(-20.0, 20.0)
readings = st.one_of(
    st.builds(imu, values, values, values, values, values, values),
    st.builds(
        DisplacementReading,
        *[st.floats(-0.1, 0.1)] * 3,
        st.sampled_from(["earth", "body"]),
        st.sampled_from([None, PERIOD_S]),
        st.integers(0, 3),
        st.booleans(),
    ),
    st.builds(PoseReading, values, values, values),
    st.just(PausedReading()),
)


@settings(max_examples=40)
@given(st.lists(readings, max_size=60))
def test_what_is_not_refused_comes_out_once_in_order_and_unchanged(given: list[Reading]) -> None:
    """Accepted readings keep their order and values. Rejected readings are removed.

    If a rejected reading reports losses, a restart or an unknown duration, a later reading reports
    this instead.
    """
    through = gate()
    came = list(chain(*admitted(given, through)))
    came += [reading for reading, _ in through.release()]
    for kinds, refused in (
        ((ImuReading, PausedReading), through.refused_imu),
        ((DisplacementReading, PoseReading, PausedReading), through.refused_displacements),
    ):
        sent = [bare(reading) for reading in given if isinstance(reading, kinds)]
        got = [bare(reading) for reading in came if isinstance(reading, kinds)]
        assert len(got) == len(sent) - refused
        rest = iter(sent)
        assert all(reading in rest for reading in got)
    lost = sum(r.lost for r in came if isinstance(r, DisplacementReading | PoseReading))
    known = [r for r in given if isinstance(r, DisplacementReading | PoseReading)]
    assert lost <= sum(r.lost for r in known) + through.refused_displacements


def bare(reading: Reading) -> Reading:
    if isinstance(reading, DisplacementReading):
        return replace(reading, lost=0, restarted=False, duration_s=None)
    return replace(reading, lost=0) if isinstance(reading, PoseReading) else reading


def test_two_displacements_that_came_with_one_read_are_believed() -> None:
    """Two displacements come from one read, so there is no time between them.

    The filter accepts both, and does not divide by zero.
    """
    through = gate()
    assert through.admit(ahead(), 1.0) == [(ahead(), 1.0)]
    at_once = replace(ahead(), duration_s=0.0)
    assert through.admit(at_once, 1.0) == [(at_once, 1.0)]
    assert through.admit(ahead(), 1.04) == [(ahead(), 1.04)]


def test_a_knock_comes_out_at_once_where_no_bits_are_sent() -> None:
    """A board sends readings as text. The filter passes the reading of a knock on at once.

    Damage to a text does not flip a single bit of a value, so the full scale is infinite.
    """
    through = OutlierFilter(replace(MotionLimits(), full_scale_mps2=math.inf), TICK_S)
    given = [imu(), imu(), imu(8.0), imu(), imu()]
    assert admitted(list(given), through) == [[reading] for reading in given]


@pytest.mark.parametrize("broken", ["pose", "twist", "covariance"])
def test_an_odometry_that_is_not_a_number_is_refused_and_counted(broken: str) -> None:
    """Odometry has NaN or infinity in its pose, twist or covariance. It is rejected and counted."""
    sound = OdometryReading(
        1.0, Pose(), BodyTwist(0.0, 0.0, 0.0), Covariance(), (0.0, 0.0), Pose(), None
    )
    values = {
        "pose": Pose(math.nan, 0.0, 0.0),
        "twist": BodyTwist(math.inf, 0.0, 0.0),
        "covariance": Covariance(xx=math.nan),
    }
    through = gate()
    assert through.admit(sound, 1.0) == [(sound, 1.0)]
    assert through.admit(replace(sound, **{broken: values[broken]}), 1.0) == []
    assert through.refused_displacements == 1


def test_an_estimate_that_is_put_right_may_leap() -> None:
    """A board's own odometry jumps, because the board corrects an earlier error.

    A filter for such odometry (``corrected=True``) releases the jump. A filter without this
    setting rejects the jump.
    """
    steps = [ahead(0.01), ahead(0.05), ahead(0.01)]
    assert admitted(steps, gate())[1] == []
    through = OutlierFilter(MotionLimits(), 0.01, corrected=True)
    assert admitted(steps, through) == [[step] for step in steps]


def test_a_correction_that_no_robot_can_drive_is_not_a_measured_motion() -> None:
    """A board corrects its own odometry by a step that no robot can drive.

    The filter (``corrected=True``) marks the step as a correction, not a motion, and rejects a step
    with NaN or infinity.
    """
    through = OutlierFilter(MotionLimits(), 0.01, corrected=True)
    steps = [ahead(), ahead(1.0), ahead(math.nan), ahead()]
    came = admitted(list(steps), through)
    correction = replace(ahead(1.0), measured=False, possible=False)
    assert came == [[ahead()], [correction], [], [ahead(lost=1)]]
    assert through.refused_displacements == 1
