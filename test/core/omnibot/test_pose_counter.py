# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what the counter of the poses shows: lost deltas and restarts."""

from collections.abc import Callable

import pytest

from omnibot_driver.core.omnibot.sequence import Sequence, Step


def counted(deltas: int) -> Sequence:
    """Return a sequence that has received ``deltas`` deltas, and a pose after every fifth delta.

    The first delta arrives at 0 s, and the others follow every 0.04 s.
    """
    sequence = Sequence()
    for count in range(deltas):
        sequence.delta(count % 256, count * 0.04)
        if count % 5 == 4:
            sequence.pose(count // 5, count * 0.04)
    return sequence


def test_a_pose_tells_of_deltas_that_it_includes_once_five_were_seen_to_come_with_it() -> None:
    """Lost deltas that a pose's counter shows are counted with the pose, not with the next delta.

    A pose comes after every fifth delta. Three deltas are lost before a pose.
    """
    sequence = Sequence()
    for count in range(10):
        sequence.delta(count, count * 0.04)
        if count % 5 == 4:
            assert sequence.pose(count // 5, count * 0.04) == Step(0)
    for count in (10, 11):
        sequence.delta(count, count * 0.04)
    assert sequence.pose(2, 14 * 0.04) == Step(3)
    assert sequence.delta(16, 16 * 0.04) == Step(1)


def test_what_several_poses_told_of_one_gap_is_not_lost_again() -> None:
    """Twelve deltas are lost, and two poses come in this gap. Each pose shows five lost deltas.

    So the next delta counts only two.
    """
    sequence = counted(10)
    told = [sequence.pose(number, (5 * number + 4) * 0.04) for number in (2, 3)]
    assert told == [Step(5), Step(5)]
    assert sequence.delta(22, 22 * 0.04) == Step(2)


@pytest.mark.parametrize("poses", [6, 60, 206])
def test_a_pose_after_a_long_gap_shows_the_losses_and_no_restart(poses: int) -> None:
    """After a long gap, a pose that arrives before the next delta shows the losses, and no restart.

    In some cases, the pose has by chance a counter that a restarted board could also send.
    """
    sequence = counted(300)
    first = 300 + 5 * poses
    assert sequence.pose((59 + poses) % 256, (first - 1) * 0.04) == Step(5 * poses)
    for count in range(first, first + 5):
        assert sequence.delta(count % 256, count * 0.04) == Step(0)
    assert sequence.pose((60 + poses) % 256, count * 0.04) == Step(0)


# 1228: both counters also fit a loss of frames. 1150: both counters show the restart. 972: only the
# counter of the poses shows the restart.
@pytest.mark.parametrize(("uptime", "ambiguous"), [(1228, True), (1150, False), (972, False)])
def test_a_pose_after_a_long_gap_is_ambiguous_if_both_counters_also_fit_a_restart(
    uptime: int, ambiguous: bool
) -> None:
    """After ``uptime`` deltas and 2.1 s of silence, the board restarts and counts from zero.

    The next pose leaves the restart in doubt only if the counters of deltas and poses both fit a
    mere loss of frames.
    """
    sequence = counted(uptime)
    begun_s = uptime * 0.04 + 2.1
    steps = [sequence.delta(count, begun_s + count * 0.04) for count in range(5)]
    pose = sequence.pose(0, begun_s + 4 * 0.04)
    assert sequence.ambiguous == ambiguous
    assert ambiguous != (pose.restarted or any(step.restarted for step in steps))
    sequence.pose(1, begun_s + 9 * 0.04)
    assert not sequence.ambiguous


@pytest.mark.parametrize("interrupt", [Sequence.pause, Sequence.reconnect])
def test_a_pause_or_a_reconnection_before_the_pose_leaves_it_ambiguous(
    interrupt: Callable[[Sequence], None],
) -> None:
    """After a gap, the counters fit both a restart and a loss of frames.

    Then the board is paused, or the port is reopened. The next pose is marked as ambiguous, because
    it may refer to a new origin.
    """
    sequence = counted(1228)
    begun_s = 1228 * 0.04 + 2.1
    for count in range(5):
        if count == 3:
            interrupt(sequence)
        sequence.delta(count, begun_s + count * 0.04)
    sequence.pose(0, begun_s + 4 * 0.04)
    assert sequence.ambiguous


# 217: the pose counter shows the restart. 1241: the pose counter also seems to have continued.
@pytest.mark.parametrize(("uptime", "restarted"), [(217, True), (1241, False)])
def test_a_restart_also_shows_if_the_deltas_have_wrapped_in_the_gap_after_it(
    uptime: int, restarted: bool
) -> None:
    """The board restarts in a gap, and by chance the delta counter seems to have continued.

    The next pose shows the restart, or is ambiguous if its counter also seems to have continued.
    """
    sequence = counted(uptime)
    # The gap lasts 12.4 s. In the gap, the board restarts and sends 270 deltas.
    for count in range(270, 275):
        step = sequence.delta(count % 256, (uptime + 39 + count) * 0.04)
        assert not step.restarted
    assert sequence.pose(54, (uptime + 39 + 274) * 0.04).restarted == restarted
    assert sequence.ambiguous != restarted


# After 7 s, the driver also supposes a wrap of the delta counter: 7 s is nearer to a wrap, 10.24 s,
# than to 0.
@pytest.mark.parametrize("silent_s", [4.0, 7.0])
@pytest.mark.parametrize("restarted", [True, False])
def test_the_next_count_after_a_silence_may_be_that_of_a_restarted_board(
    restarted: bool, silent_s: float
) -> None:
    """A delta continues the count after a silence. A restarted board could send the same count.

    The driver suspects a restart, and marks it as doubtful. The counter of the next pose decides.
    """
    uptime = 331 if restarted else 30
    sequence, first_s = counted(uptime), uptime * 0.04 + silent_s
    steps = [sequence.delta((uptime + n) % 256, first_s + n * 0.04) for n in range(5)]
    assert [step.restarted for step in steps] == [True, False, False, False, False]
    assert steps[0].doubtful
    pose = sequence.pose(15 if restarted else 6, first_s + 0.16)
    assert pose.restarted == restarted


# 51: the pose counter continues its old count, so the counter of the delta may be damaged.
# 30: the pose counter is not near 0, and does not continue its old count.
@pytest.mark.parametrize(("number", "restarted"), [(2, True), (51, False), (30, False)])
def test_the_pose_after_a_restart_of_the_delta_counter_shows_it_too_if_it_also_begins_anew(
    number: int, restarted: bool
) -> None:
    """A delta seems to show a restart.

    The next pose confirms the restart only if the pose counter is near 0.
    """
    sequence = counted(200)
    after_s = 199 * 0.04 + 2.1
    assert sequence.delta(14, after_s).restarted
    assert sequence.pose(number, after_s) == Step(0, None if restarted else 0.04, restarted)


@pytest.mark.parametrize("lost", [1300, 2600])
def test_the_first_pose_after_a_gap_in_which_its_counter_wraps_shows_no_restart(lost: int) -> None:
    """The first pose after a gap in which the pose counter wraps does not show a restart.

    More than 256 poses are lost, in over 51.2 s.
    """
    sequence = counted(50)
    for count in range(50 + lost, 60 + lost):
        step = sequence.delta(count % 256, count * 0.04)
        assert step == Step(lost if count == 50 + lost else 0)
        if count % 5 == 4:
            pose = sequence.pose(count // 5 % 256, count * 0.04)
            assert not pose.lost
            assert not pose.restarted


def test_where_zero_fits_the_old_count_by_chance_the_pose_counter_tells_of_the_restart() -> None:
    """The delta counter restarts at 0. By chance, 0 also fits the old count and the elapsed time.

    The counter of the next pose is also 0, which shows the restart.
    """
    sequence = counted(206)
    after_s = 205 * 0.04 + 2.0
    assert sequence.delta(0, after_s) == Step(50)
    for count in range(1, 5):
        assert sequence.delta(count, after_s + count * 0.04) == Step(0)
    assert sequence.pose(0, after_s + 0.16).restarted


def test_a_pose_tells_of_a_restart_also_while_the_count_before_it_is_ahead_of_the_time() -> None:
    """After a restart, a delta and then a pose have the counter 0.

    The delta alone does not prove the restart, but the pose does. The driver counts no delta as
    lost.
    """
    sequence = Sequence()
    for count in range(171):
        sequence.delta(count, count * 0.04, imus=4)
        if count % 5 == 0:
            sequence.pose(count // 5, count * 0.04)
    sequence.delta(0, 9.84, imus=4)
    assert sequence.pose(0, 9.84).restarted
    assert sequence.delta(1, 9.88, imus=4) == Step(0)


def reopened() -> Sequence:
    """Return the state after the deltas 0 to 205, their poses, and a reconnection."""
    sequence = counted(206)
    sequence.reconnect()
    return sequence


def test_the_pose_counter_also_tells_of_a_restart_while_the_port_was_closed() -> None:
    """The board restarts while the port is closed.

    By chance, the delta counter seems to have continued, but the pose counter shows the restart.
    """
    sequence = reopened()
    after_s = 205 * 0.04 + 2.0
    for count in range(5):
        sequence.delta(count, after_s + count * 0.04)
    assert sequence.pose(0, after_s + 0.16).restarted


@pytest.mark.parametrize("lost", [1, 7, 60, 255, 256, 1280, 1500])
def test_the_pose_counter_goes_on_while_the_port_is_closed(lost: int) -> None:
    """The board continues to count while the port is closed.

    Afterwards, no delta or pose shows a restart.
    """
    sequence = Sequence()
    counts = [*range(206), *range(206 + lost, 300 + lost)]
    for count in counts:
        if count == 206 + lost:
            sequence.reconnect()
        assert not sequence.delta(count % 256, count * 0.04).restarted
        if count % 5 == 4:
            assert not sequence.pose(count // 5 % 256, count * 0.04).restarted


@pytest.mark.parametrize("first", range(900, 1200, 50))
def test_after_an_hour_the_pose_counter_does_not_tell_of_a_restart(first: int) -> None:
    """A board runs on while the port is closed for an hour. No pose shows a restart.

    The number of wraps of the delta counter is unknown, because the board's clock is slow by 0.3 %.
    """
    sequence = Sequence()
    for count in [*range(first, first + 206), *range(first + 90_000, first + 90_050)]:
        now = count * 0.04 * 1.003
        if count == first + 90_000:
            sequence.reconnect()
        assert not sequence.delta(count % 256, now).restarted
        if count % 5 == 4:
            assert not sequence.pose(count // 5 % 256, now).restarted


def test_a_pose_that_comes_first_after_a_reconnection_tells_of_no_losses() -> None:
    """The first frame after a reconnection is a restarted board's pose. It shows no losses.

    The pose counter began at zero again, so its difference from the old counter means nothing.
    """
    sequence = reopened()
    assert sequence.pose(3, 205 * 0.04 + 60.0).lost == 0


def test_a_pose_that_comes_first_after_a_reconnection_is_not_counted_against_earlier_losses() -> (
    None
):
    """Deltas are lost, and then the first frame after a reconnection is a pose.

    The pose's counter does not fit the received deltas, but the driver does not suspect a restart.
    """
    sequence, restarts = Sequence(), []
    for count in [*range(25), *range(49, 75)]:
        now = count * 0.04
        if count == 49:
            sequence.reconnect()
        else:
            restarts.append(sequence.delta(count, now).restarted)
        if count % 5 == 4 and count != 54:
            restarts.append(sequence.pose(count // 5, now).restarted)
    assert not any(restarts)


def test_a_pose_of_another_rhythm_tells_nothing() -> None:
    """The board sends a pose after every second delta, not after every fifth.

    The counter of a pose then does not show whether deltas were lost.
    """
    sequence = Sequence()
    for count in range(20):
        assert sequence.delta(count, count * 0.04) == Step(0)
        if count % 2:
            assert sequence.pose(count // 2, count * 0.04) == Step(0)


def test_a_pose_counter_that_begins_anew_is_not_a_gap() -> None:
    """A pose counter that begins at 0 again after only 1 s shows no losses.

    For a wrap, the board would need more time.
    """
    sequence = counted(25)
    assert sequence.pose(0, 25 * 0.04 + 1.0) == Step(0)


def test_a_count_that_a_pose_has_told_of_needs_no_time() -> None:
    """A pose shows that delta 14 is lost. Delta 15 follows after only 20 ms.

    The driver accepts the count 15, and does not count the loss again.
    """
    sequence = Sequence()
    for count in range(11):
        sequence.delta(count, count * 0.04, imus=4)
        if count % 5 == 4:
            sequence.pose(count // 5, count * 0.04)
    for count in (11, 12, 13):
        sequence.delta(count, 0.56, imus=4)
    assert sequence.pose(2, 0.56) == Step(1)
    assert sequence.delta(15, 0.58, imus=4) == Step(0)
    assert sequence.delta(16, 0.64, imus=4) == Step(0)
