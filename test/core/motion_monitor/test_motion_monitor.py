# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the motion monitor with displacements given by hand, every 40 ms of board time."""

import math
from collections import deque

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.monitor import Fault, MotionMonitor

PERIOD_S = 0.04
REST = (0.0, 0.0, 0.0)
Triple = tuple[float, float, float]


class Drive:
    """A motion monitor. Its robot has been at rest for two seconds."""

    def __init__(self) -> None:
        self.monitor, self.now = MotionMonitor(), 100.0
        self.command(*REST)
        assert self.move(REST, 2.0) == []

    def command(self, x: float, y: float, yaw: float) -> None:
        self.monitor.set_point(BodyTwist(x, y, yaw), self.now)

    def move(
        self, motion: Triple, seconds: float, *, heading_known: bool = True
    ) -> list[tuple[float, Fault]]:
        """Move with the twist ``motion`` for ``seconds``.

        Return each fault with its time since the start, in s.
        """
        begun, found = self.now, []
        for _ in range(round(seconds / PERIOD_S)):
            self.now += PERIOD_S
            fault = self.monitor.check(
                BodyTwist(*motion), PERIOD_S, self.now, heading_known=heading_known
            )
            if fault is not None:
                found.append((round(self.now - begun, 2), fault))
        return found


def first(found: list[tuple[float, Fault]]) -> tuple[float, Fault]:
    assert found
    return found[0]


DISOBEYING = {
    "the wrong way": ((0.05, 0.0, 0.0), (-0.05, 0.0, 0.0), Fault.WRONG_WAY),
    "fast the wrong way": ((0.05, 0.0, 0.0), (-0.3, 0.0, 0.0), Fault.WRONG_WAY),
    "sideways": ((0.3, 0.0, 0.0), (0.0, 0.3, 0.0), Fault.WRONG_WAY),
    "x and y swapped": ((0.2, 0.1, 0.0), (-0.1, 0.2, 0.0), Fault.WRONG_WAY),
    "a turn becomes a drive": ((0.0, 0.0, 0.5), (0.1, 0.0, 0.0), Fault.WRONG_WAY),
    "more than twice as fast": ((0.5, 0.0, 0.0), (1.19, 0.0, 0.0), Fault.TOO_FAST),
    "slow, but twice as fast": ((0.06, 0.0, 0.0), (0.12, 0.0, 0.0), Fault.TOO_FAST),
    "turns the wrong way": ((0.0, 0.0, 0.15), (0.0, 0.0, -0.15), Fault.WRONG_TURN),
    "turns although it is to drive": ((0.1, 0.0, 0.0), (0.1, 0.0, 0.3), Fault.WRONG_TURN),
    "turns twice as fast": ((0.0, 0.0, 0.2), (0.0, 0.0, 0.4), Fault.TURNS_TOO_FAST),
}


@pytest.mark.parametrize(("commanded", "motion", "fault"), DISOBEYING.values(), ids=DISOBEYING)
def test_a_robot_that_moves_otherwise_than_commanded_is_found_out_within_0_3_s(
    commanded: Triple, motion: Triple, fault: Fault
) -> None:
    """The robot does not move as commanded, from the start or after it has obeyed for two seconds.

    The monitor finds the fault within 0.3 s.
    """
    for obeyed_s in (0.0, 2.0):
        drive = Drive()
        drive.command(*commanded)
        assert drive.move(commanded, obeyed_s) == []
        found_s, found = first(drive.move(motion, 1.0))
        assert found is fault
        assert found_s <= 0.28
        assert drive.monitor.measured == BodyTwist(*motion)
        assert drive.monitor.commanded == BodyTwist(*commanded)


@pytest.mark.parametrize("time_constant_s", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("speed_mps", [0.1, 0.3, 0.5])
def test_a_slow_robot_that_goes_the_wrong_way_is_found_out_within_0_3_s(
    speed_mps: float, time_constant_s: float
) -> None:
    """The monitor finds that a robot speeds up slowly in the wrong direction.

    It does so within 0.3 s after the robot has reached 0.05 m/s.
    """
    drive = Drive()
    drive.command(speed_mps, 0.0, 0.0)
    wrong_s = -time_constant_s * math.log(1.0 - 0.05 / speed_mps)
    for step in range(1, 50):
        since_s = step * PERIOD_S
        part = 1.0 - math.exp(-(since_s - PERIOD_S / 2) / time_constant_s)
        if found := drive.move((-part * speed_mps, 0.0, 0.0), PERIOD_S):
            break
    assert first(found)[1] is Fault.WRONG_WAY
    assert since_s - wrong_s <= 0.3


@pytest.mark.parametrize("motion", [(0.05, 0.0, 0.0), (0.0, -0.3, 0.0), (0.0, 0.0, 0.15)])
def test_a_robot_that_stood_and_moves_without_a_command_is_found_out_within_0_3_s(
    motion: Triple,
) -> None:
    """A person pushes the robot, or the board obeys a command that is not from the driver.

    The monitor finds the motion without a command within 0.3 s.
    """
    found_s, fault = first(Drive().move(motion, 1.0))
    assert fault is Fault.UNCOMMANDED
    assert found_s <= 0.28


@pytest.mark.parametrize("scale", [0.5, 0.75, 1.25])
@pytest.mark.parametrize("commanded", [(0.05, 0.0, 0.0), (0.3, -0.4, 0.5), (0.0, 0.0, 0.15)])
def test_scales_that_are_off_by_a_quarter_do_not_trip(commanded: Triple, scale: float) -> None:
    """A robot may be 25 % too fast, or half as fast as commanded, without a fault."""
    drive = Drive()
    drive.command(*commanded)
    x, y, yaw = (scale * value for value in commanded)
    assert drive.move((x, y, yaw), 10.0) == []


@pytest.mark.parametrize("commanded", [(0.05, 0.0, 0.0), (0.3, -0.4, 0.5), (0.0, 0.0, 0.15)])
def test_a_robot_that_stays_at_rest_is_only_found_to_be_blocked(commanded: Triple) -> None:
    """A robot stays at rest. The only fault is "blocked", and only if a fast drive is commanded.

    If a slow drive or a slow turn is commanded, the monitor finds no fault.
    """
    drive = Drive()
    drive.command(*commanded)
    blocked = {Fault.BLOCKED} if commanded[0] > 0.05 else set()
    assert {fault for _, fault in drive.move(REST, 10.0)} == blocked


@given(motions=st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), min_size=2, max_size=2))
def test_two_damaged_displacements_in_a_row_do_not_trip(motions: list[Triple]) -> None:
    """Two displacements in a row are damaged. Whatever their size, the monitor finds no fault."""
    drive = Drive()
    drive.command(0.3, 0.0, 0.0)
    drive.move((0.3, 0.0, 0.0), 1.0)
    assert [drive.move(motion, PERIOD_S) for motion in motions] == [[], []]
    assert drive.move((0.3, 0.0, 0.0), 1.0) == []


def test_a_new_command_may_be_followed_late() -> None:
    """A reversal is commanded. The robot begins it 0.3 s late, with a time constant of 0.15 s.

    The monitor finds no fault.
    """
    drive = Drive()
    drive.command(0.5, 0.0, 0.5)
    drive.move((0.5, 0.0, 0.5), 1.0)
    drive.command(-0.5, 0.0, -0.5)
    assert drive.move((0.5, 0.0, 0.5), 0.28) == []
    for step in range(25):
        part = 2 * math.exp(-step * PERIOD_S / 0.15) - 1
        assert drive.move((part * 0.5, 0.0, part * 0.5), PERIOD_S) == []


def test_a_command_that_is_not_followed_at_all_is_found_out() -> None:
    """The monitor finds a fault if the robot is commanded to slow down, but keeps its speed."""
    drive = Drive()
    drive.command(0.5, 0.0, 0.0)
    drive.move((0.5, 0.0, 0.0), 1.0)
    drive.command(0.1, 0.0, 0.0)
    found_s, fault = first(drive.move((0.5, 0.0, 0.0), 2.0))
    assert fault is Fault.TOO_FAST
    assert found_s <= 0.6


def test_two_senders_in_turn_do_not_trip() -> None:
    """One sender commands 0.4 m/s, and another sender commands rest. The robot moves at 0.2 m/s.

    The monitor finds no fault.
    """
    drive = Drive()
    for step in range(100):
        drive.command(*((0.4, 0.0, 0.0) if step % 2 else REST))
        drive.now += 0.01
        drive.command(*(REST if step % 2 else (0.4, 0.0, 0.0)))
        drive.now -= 0.01
        assert drive.move((0.2, 0.0, 0.0), PERIOD_S) == []


def test_without_the_heading_only_the_length_of_the_velocity_is_judged() -> None:
    """The robot's heading is unknown, so forward and backward look alike.

    The monitor compares only the speed with the command.
    """
    drive = Drive()
    drive.command(0.2, 0.0, 0.0)
    assert drive.move((-0.2, 0.0, 0.0), 2.0, heading_known=False) == []
    assert first(drive.move((0.0, -0.5, 0.0), 1.0, heading_known=False))[1] is Fault.TOO_FAST


def test_on_the_way_to_a_goal_nothing_is_judged() -> None:
    """On the way to a goal, the board itself chooses the motion. The monitor finds no fault."""
    drive = Drive()
    drive.monitor.set_point(None, drive.now)
    assert drive.move((-1.5, 0.0, 3.0), 5.0) == []


def test_a_robot_that_is_commanded_and_does_not_move_is_told_of_after_a_second() -> None:
    """A commanded robot does not move.

    The monitor returns the fault ``BLOCKED`` each second, or ``HELD_BY_ESTOP`` if the driver's
    e-stop was released before.
    """
    drive = Drive()
    drive.command(0.06, 0.0, 0.0)
    found = drive.move(REST, 2.4)
    assert [fault for _, fault in found] == [Fault.BLOCKED] * 2
    assert found[0][0] == pytest.approx(1.0, abs=0.05)
    drive.monitor.release()
    assert first(drive.move(REST, 1.2))[1] is Fault.HELD_BY_ESTOP


def test_what_a_held_robot_has_lost_it_may_catch_up() -> None:
    """A robot that was held may drive too fast until it has made up for the lost distance.

    Afterwards, too high a speed is a fault.
    """
    drive = Drive()
    drive.command(0.4, 0.0, 0.0)
    drive.move((0.4, 0.0, 0.0), 1.0)
    drive.move(REST, 0.96)
    assert drive.move((0.9, 0.0, 0.0), 0.6) == []
    assert drive.move((0.4, 0.0, 0.0), 20.0) == []
    assert first(drive.move((0.9, 0.0, 0.0), 0.6))[1] is Fault.TOO_FAST


def test_what_was_pushed_while_it_stood_may_come_back() -> None:
    """A robot at rest is pushed forward, so its wheel controllers wind up.

    At the next command, the robot may move back for a moment. The monitor finds no fault.
    """
    drive = Drive()
    drive.move((0.3, 0.0, 0.0), 1.0)
    drive.command(0.1, 0.0, 0.0)
    assert drive.move((-0.3, 0.0, 0.0), 0.6) == []
    assert first(drive.move((-0.3, 0.0, 0.0), 2.0))[1] is Fault.WRONG_WAY


def test_the_stops_for_a_robot_that_is_pushed_get_rarer() -> None:
    """A robot that has obeyed Stop is pushed. The monitor reports faults at ever longer intervals.

    The driver sends Stop for each fault.
    """
    times = [found_s for found_s, _ in Drive().move((0.3, 0.0, 0.0), 80.0)]
    assert times[0] <= 0.2
    assert [time - times[0] for time in times] == pytest.approx([0, 5, 15, 35, 75], abs=1.0)


def test_the_stops_for_a_robot_that_was_driven_and_goes_on_do_not_get_rarer() -> None:
    """A driven robot does not obey Stop.

    The monitor reports a fault every 5 s, and the interval does not grow, because a repeated Stop
    may still reach the board.
    """
    drive = Drive()
    drive.command(0.3, 0.0, 0.0)
    drive.move((0.3, 0.0, 0.0), 1.0)
    drive.command(*REST)
    found = drive.move((0.3, 0.0, 0.0), 30.0)
    assert {fault for _, fault in found} == {Fault.UNCOMMANDED}
    times = [found_s for found_s, _ in found]
    assert times[0] <= 0.6
    assert len(times) == 6


def test_how_a_stopped_robot_rolls_out_is_not_a_second_fault() -> None:
    """A robot moves the wrong way, is stopped and rolls out. This motion is not a second fault."""
    drive = Drive()
    drive.command(0.05, 0.0, 0.0)
    assert first(drive.move((-0.3, 0.0, 0.0), 0.2))[1] is Fault.WRONG_WAY
    drive.command(*REST)
    for step in range(50):
        part = math.exp(-step * PERIOD_S / 0.2)
        assert drive.move((-0.3 * part, 0.0, 0.0), PERIOD_S) == []


def test_four_displacements_in_a_row_that_no_robot_can_have_made_are_a_fault() -> None:
    """The outlier filter rejects four displacements in a row as impossible. This is a fault.

    If a plausible displacement comes between the rejected ones, there is no fault.
    """
    drive = Drive()
    assert [drive.monitor.count_refused(count, drive.now) for count in range(4)] == [None] * 4
    drive.move(REST, PERIOD_S)
    assert [drive.monitor.count_refused(count, drive.now) for count in range(4, 7)] == [None] * 3
    assert drive.monitor.count_refused(7, drive.now) is Fault.UNCOMMANDED
    drive.command(0.1, 0.0, 0.0)
    assert drive.monitor.count_refused(11, drive.now) is Fault.BEYOND_LIMITS


def test_four_impossible_displacements_are_a_fault_and_a_single_one_is_a_correction() -> None:
    """Four impossible displacements in a row are a fault.

    Up to three in a row may be a correction of the board's own odometry. A robot that rolls out
    after the fault causes no second fault.
    """
    drive = Drive()
    drive.command(0.1, 0.0, 0.0)
    assert drive.monitor.count_impossible(drive.now) is None
    for _ in range(2):
        drive.move((0.1, 0.0, 0.0), PERIOD_S)
        assert [drive.monitor.count_impossible(drive.now) for _ in range(3)] == [None] * 3
    assert drive.monitor.count_impossible(drive.now) is Fault.BEYOND_LIMITS
    drive.command(*REST)
    assert [drive.monitor.count_impossible(drive.now + 0.5) for _ in range(8)] == [None] * 8
    drive.now += 1.0
    found = [drive.monitor.count_impossible(drive.now) for _ in range(4)]
    assert found == [None, None, None, Fault.UNCOMMANDED]


def test_a_fault_is_news_until_the_robot_has_obeyed() -> None:
    """A fault that occurs repeatedly is new to the user only the first time.

    After the robot has obeyed a command, the same fault is new again.
    """
    drive = Drive()
    assert drive.monitor.is_news(Fault.BLOCKED)
    assert not drive.monitor.is_news(Fault.BLOCKED)
    drive.command(0.3, 0.0, 0.0)
    drive.move((0.3, 0.0, 0.0), 0.2)
    assert drive.monitor.is_news(Fault.BLOCKED)


twists = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-1.5, 1.5))
orders = st.lists(
    st.tuples(st.one_of(st.just(REST), twists), st.sampled_from([1, 2, 5, 10, 30, 100])),
    max_size=12,
)


@pytest.mark.slow
@settings(deadline=None)
@given(
    orders,
    st.integers(0, 10),
    st.floats(0.01, 0.2),
    st.tuples(*[st.floats(0.85, 1.05)] * 3),
)
def test_a_robot_that_obeys_late_and_with_slip_never_trips(
    given_orders: list[tuple[Triple, int]], late_ticks: int, constant_s: float, scale: Triple
) -> None:
    """A robot that obeys up to 0.1 s late, with a time constant of up to 0.2 s, causes no fault.

    The only exception is "blocked", which does not stop the robot.
    """
    drive, tick_s = Drive(), 0.01
    x = y = yaw = 0.0
    way = [0.0, 0.0, 0.0]
    line = deque([REST] * late_ticks)
    tick = 0
    for order, ticks in [*given_orders, (REST, 200)]:
        drive.monitor.set_point(BodyTwist(*order), drive.now)
        for _ in range(ticks):
            line.append(order)
            kept = math.exp(-tick_s / constant_s)
            x, y, yaw = (
                part * goal + kept * (value - part * goal)
                for value, goal, part in zip((x, y, yaw), line.popleft(), scale, strict=True)
            )
            way = [w + tick_s * value for w, value in zip(way, (x, y, yaw), strict=True)]
            tick += 1
            drive.now += tick_s
            if tick % 4 == 0:
                motion = BodyTwist(*(w / PERIOD_S for w in way))
                way = [0.0, 0.0, 0.0]
                fault = drive.monitor.check(motion, PERIOD_S, drive.now, heading_known=True)
                assert fault in (None, Fault.BLOCKED)
