# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the proof that a robot is at rest, by the displacements that its board reports."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from robots import driving
from session_bench import Bench

from omnibot_driver.core.commands.stop_proof import STILL_MPS, STILL_RADPS, StopProof
from omnibot_driver.core.omnibot.frames import DELTA_HEADER
from omnibot_driver.core.readings import DisplacementReading

PERIOD_S = 0.04


def moved(speed_mps: float = 0.0, rate_radps: float = 0.0, lost: int = 0) -> DisplacementReading:
    return DisplacementReading(
        speed_mps * PERIOD_S,
        0.0,
        rate_radps * PERIOD_S,
        frame="body",
        duration_s=PERIOD_S,
        lost=lost,
    )


def shown(proof: StopProof, *speeds: float, begin_s: float = 10.0) -> bool:
    """Deliver a displacement for each of ``speeds``; return whether these displacements prove rest.

    ``speeds``: in m/s. The displacements arrive 40 ms apart.
    """
    for number, speed in enumerate(speeds):
        proof.look(moved(speed), begin_s + 0.1 + number * PERIOD_S)
    return proof.proved


@pytest.fixture
def proof() -> StopProof:
    stopped = StopProof()
    stopped.stopped(10.0)
    return stopped


def test_three_displacements_of_nothing_after_stop_are_a_proof(proof: StopProof) -> None:
    """Three displacements of zero, in 0.12 s, prove rest. Two are not enough."""
    assert not shown(proof, 0.0, 0.0)
    assert shown(proof, 0.0, 0.0, 0.0)


def test_a_proof_takes_as_long_as_its_displacements_need_to_come(proof: StopProof) -> None:
    """If displacements arrive only every 0.4 s, the proof of rest takes longer than usual.

    The first displacement after Stop may have begun before Stop, so it proves nothing.
    """
    assert proof.takes_s < 0.3
    rare = DisplacementReading(0.04, 0.0, 0.0, frame="body", duration_s=0.4, lost=0)
    proof.look(rare, 10.3)
    still = DisplacementReading(0.0, 0.0, 0.0, frame="body", duration_s=0.4, lost=0)
    proof.look(still, 10.7)
    proof.look(still, 11.1)
    assert proof.proved
    assert 1.1 < proof.takes_s < 1.3
    proof.look(DisplacementReading(0.0, 0.0, 0.0, frame="body", duration_s=60.0, lost=0), 71.1)
    assert proof.takes_s < 4.0  # the long displacement is taken for a gap


def test_one_displacement_alone_is_not_a_proof_however_long_it_is(proof: StopProof) -> None:
    """One displacement of zero after Stop does not prove rest, even if it covers 0.1 s.

    Two such displacements prove rest.
    """
    long = DisplacementReading(0.0, 0.0, 0.0, frame="body", duration_s=0.1, lost=0)
    proof.look(long, 10.1)
    assert not proof.proved
    proof.look(long, 10.2)
    assert proof.proved


def test_without_stop_standing_still_proves_nothing() -> None:
    """No Stop was sent, so a command may still be on its way.

    Displacements of zero prove nothing.
    """
    assert not shown(StopProof(), *[0.0] * 50)


def test_a_command_to_move_ends_the_proof(proof: StopProof) -> None:
    """After a command to move, displacements of zero prove nothing until the next Stop."""
    assert shown(proof, 0.0, 0.0, 0.0)
    proof.moved()
    assert not proof.proved
    assert not shown(proof, *[0.0] * 50)


def test_what_may_have_been_measured_before_stop_counts_for_nothing(proof: StopProof) -> None:
    """A displacement that arrives within 50 ms after Stop does not prove rest.

    It may have ended before Stop arrived.
    """
    for _ in range(10):
        proof.look(moved(), 10.049)
    assert not proof.proved


def test_a_proof_is_owed_from_the_first_motion_to_the_next_proof(proof: StopProof) -> None:
    """After a drive, ``owed`` is true: a proof of rest is still needed.

    Only displacements of zero give this proof; a new connection or a Stop does not.
    """
    assert not proof.owed
    proof.moved()
    proof.stopped(10.0)
    proof.begin()
    assert proof.owed
    proof.stopped(10.0)
    assert shown(proof, 0.0, 0.0, 0.0)
    assert not proof.owed


@pytest.mark.parametrize("moving", [moved(0.011), moved(0.0, 0.031), moved(-0.3), moved(0.0, -1.0)])
def test_a_robot_that_moves_is_not_proved_to_stand(
    proof: StopProof, moving: DisplacementReading
) -> None:
    """Rest is proved. Then a displacement arrives that is too large for a robot at rest.

    This displacement ends the proof.
    """
    assert shown(proof, 0.0, 0.0, 0.0)
    proof.look(moving, 11.0)
    assert not proof.proved


def test_a_displacement_of_unknown_duration_is_not_evidence(proof: StopProof) -> None:
    """Displacements of unknown duration, for example after a pause, do not prove rest."""
    for number in range(50):
        unknown = DisplacementReading(0.0, 0.0, 0.0, frame="body", duration_s=None, lost=0)
        proof.look(unknown, 10.1 + number * PERIOD_S)
    assert not proof.proved


def test_a_paused_board_has_its_motors_off(proof: StopProof) -> None:
    """A board reports that it is paused. This proves that the robot is at rest.

    No displacement is needed for this proof.
    """
    proof.paused()
    assert proof.proved


@given(
    st.lists(st.floats(0.0, 0.5)),
    st.floats(0.0, STILL_MPS * 0.9),
    st.floats(0.0, STILL_RADPS * 0.9),
)
def test_whatever_came_before_standing_for_long_enough_proves_it(
    before: list[float], speed_mps: float, rate_radps: float
) -> None:
    """Four displacements in a row that are close to zero prove rest.

    It does not matter how the robot has moved before.
    """
    proof = StopProof()
    proof.stopped(10.0)
    shown(proof, *before)
    for number in range(4):
        proof.look(moved(speed_mps, rate_radps), 100.0 + number * PERIOD_S)
    assert proof.proved


def without_deltas(bench: Bench) -> None:
    """Discard all delta frames from now on. IMU frames and poses still arrive."""
    step = bench.board.step

    def heard() -> bytes:
        step()
        sent = [each.data for each in bench.board.sent if each.tick == bench.board.tick]
        return b"".join(data for data in sent if not data.startswith(DELTA_HEADER))

    bench.board.step = heard  # type: ignore[method-assign]


def test_the_log_does_not_say_that_a_robot_moves_where_no_displacement_shows_it() -> None:
    """All delta frames are lost.

    The log says that the stop is unconfirmed, not that the robot moves.
    """
    bench = driving()
    without_deltas(bench)
    bench.run(8.0)
    assert bench.still()
    (said,) = (text for text in bench.notices if "unconfirmed" in text)
    assert "no odometry frames from the board" in said


def test_the_log_says_that_a_robot_moves_where_displacements_show_it() -> None:
    """The board does not receive Stop, and the motion monitor is off.

    The log says that the robot still moves.
    """
    bench = driving()
    bench.configure(motion_monitor=False)
    bench.hears = False
    bench.run(8.0)
    (said,) = (text for text in bench.notices if "unconfirmed" in text)
    assert "still moves" in said
