# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of tick counts with encoders of few and of many ticks per turn (the resolution)."""

import math
from dataclasses import replace
from itertools import accumulate, cycle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.lois_ecu import BoardOdometry, Heading, SetRpm, Ticks, encode_report
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.late_reads import LateReads
from omnibot_driver.core.lois_ecu.messages import Report
from omnibot_driver.core.lois_ecu.plausibility import ClockUnit, TicksGate
from omnibot_driver.core.lois_ecu.reset_proof import ResetProof
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.stall import StallWatch
from omnibot_driver.core.lois_ecu.translation import Translation
from omnibot_driver.core.readings import ResetReading

PER_TURN = (1, 2, 6, 25, 60, 360, 1000, 20_000, 1_000_000)
RESOLUTIONS = pytest.mark.parametrize("per_turn", PER_TURN)
NS_PER_COUNT: dict[ClockUnit, int] = {"ms": 1_000_000, "ns": 1}
SPEEDS = st.floats(-50.0, 50.0)
DRIVES = st.lists(st.tuples(st.floats(0.05, 0.5), SPEEDS, SPEEDS), min_size=1, max_size=30)
"""Steps of a drive: each has a duration in s and the speeds of left and right wheel in RPM."""
OUT_AND_BACK = [*[(0.2, 50.0, 50.0)] * 30, *[(0.2, -50.0, -50.0)] * 50]


def reports(
    drive: list[tuple[float, float, float]], per_turn: int, unit: ClockUnit
) -> list[tuple[float, Ticks]]:
    """Return the tick reports after each step of a drive, with their times in s."""
    at_s = accumulate(step[0] for step in drive)
    left = accumulate(seconds * rpm / 60 for seconds, rpm, _ in drive)
    right = accumulate(seconds * rpm / 60 for seconds, _, rpm in drive)
    return [
        (
            now,
            Ticks(
                round((100 + now) * 1e9) // NS_PER_COUNT[unit] % (1 << 32),
                math.floor(left_turns * per_turn),
                math.floor(right_turns * per_turn),
            ),
        )
        for now, left_turns, right_turns in zip(at_s, left, right, strict=True)
    ]


@given(DRIVES, st.integers(1, 1_000_000), st.floats(0.0, 0.3))
def test_no_count_of_a_rolling_wheel_is_implausible(
    drive: list[tuple[float, float, float]], per_turn: int, late_s: float
) -> None:
    """Wheels roll at up to 50 RPM in both directions. Every second read is late.

    All tick reports are accepted, whatever the resolution of the encoders is.
    """
    gate = TicksGate(per_turn)
    now = 0.0
    for number, (at_s, ticks) in enumerate(reports(drive, per_turn, "ms")):
        now = max(now, at_s + late_s * (number % 2))
        assert gate.passes(ticks, now)


@RESOLUTIONS
def test_a_count_that_leaps_by_five_turns_is_implausible(per_turn: int) -> None:
    """A count changes by five turns of the wheel in 0.2 s. The report is rejected.

    The other reports, of a wheel at 20 RPM, are accepted.
    """
    gate = TicksGate(per_turn)
    for number, (now, ticks) in enumerate(reports([(0.2, 20.0, 20.0)] * 20, per_turn, "ms")):
        leaps = number == 10
        heard = replace(ticks, left=ticks.left + 5 * per_turn) if leaps else ticks
        assert gate.passes(heard, now) is not leaps


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["ms", "ns"])
@settings(max_examples=40)
@given(drive=DRIVES, per_turn=st.sampled_from(PER_TURN))
def test_wheels_that_roll_back_are_no_restart(
    unit: ClockUnit, drive: list[tuple[float, float, float]], per_turn: int
) -> None:
    """Falling counts of wheels that roll to and fro do not show a restart, at any resolution.

    The counts are signed, and the wheels roll at up to 50 RPM.
    """
    translation = Translation(LoisEcuSettings(ticks_per_revolution=per_turn))
    for now, ticks in reports(drive, per_turn, unit):
        translation.readings([ticks], [now], unit, now)
    assert translation.counts.restarts == 0


@pytest.mark.slow
@pytest.mark.parametrize(("per_turn", "unit"), [*zip(PER_TURN, cycle(("ms", "ns")), strict=False)])
def test_signed_counts_are_followed_out_and_back(per_turn: int, unit: ClockUnit) -> None:
    """The distance of a drive out and back is right within two ticks or 0.03 m, the larger of both.

    The driver detects no restart during the drive. It detects the real restart after the drive.
    """
    ours = LoisEcuSettings(ticks_per_revolution=per_turn)
    translation, odometry = Translation(ours), BoardOdometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for now, ticks in (heard := reports(OUT_AND_BACK, per_turn, unit)):
        rpm = 50 if now < 6.0 else -50
        translation.odometry.wrote(SetRpm(rpm, rpm), now - 0.1)
        translation.readings([ticks, odometry], [now, now], unit, now)
    assert translation.counts.restarts == 0
    now, last = heard[-1]
    predicted = translation.odometry.predict(now)
    assert predicted is not None
    way_m = (last.left - heard[0][1].left) * ours.tick_m
    assert predicted.pose.x_m == pytest.approx(way_m, abs=max(0.03, 2 * ours.tick_m))
    age = round(0.1e9) // NS_PER_COUNT[unit]
    translation.readings([Ticks(age, 0, 0)], [now + 0.2], unit, now + 0.2)
    assert translation.counts.restarts == 1


@RESOLUTIONS
def test_a_reset_is_proved_while_the_wheels_roll_out(per_turn: int) -> None:
    """A reset is proved by counts near zero, although the wheels roll on by a quarter turn."""
    proof = ResetProof(Ticks(1000, 9 * per_turn, 9 * per_turn), per_turn, steady=False)
    rolled = math.ceil(per_turn / 4)
    assert not proof.look(Ticks(1200, 9 * per_turn + rolled, 9 * per_turn), 1.2)
    assert proof.look(Ticks(1400, rolled, 0), 1.4)
    assert proof.remark == ""


@given(st.integers(1, 1_000_000), st.floats(0.0, 1.0), st.floats(-0.25, 0.25))
def test_a_wheel_that_rolls_back_proves_no_reset(
    per_turn: int, before_turns: float, after_turns: float
) -> None:
    """A count that falls from at most one turn to nearly zero does not prove a reset of the board.

    The wheel may have rolled back.
    """
    before, after = math.floor(before_turns * per_turn), math.floor(after_turns * per_turn)
    proof = ResetProof(Ticks(1000, before, before), per_turn, steady=False)
    assert not proof.look(Ticks(1200, after, after), 1.2)


@RESOLUTIONS
def test_a_jolt_of_one_tick_at_rest_proves_no_reset(per_turn: int) -> None:
    """A count that falls from 1 to 0 at rest, by a jolt, does not prove a reset."""
    proof = ResetProof(Ticks(1000, 1, 0), per_turn, steady=True)
    assert not proof.look(Ticks(1200, 0, 0), 1.2)


@RESOLUTIONS
def test_a_late_read_may_contain_a_restart(per_turn: int) -> None:
    """All reports of a late read that may contain a restart get the time of the read.

    In its last report, the clock (in ns) and the counts are near zero, as after a restart.
    """
    late_reads = LateReads(per_turn)
    for number in range(6):
        at_s = 10.0 + 0.2 * number
        ticks = Ticks(round(number * 0.2e9), 2 * per_turn, 2 * per_turn)
        assert late_reads.times([ticks], [at_s], "ns") == [at_s]
    rolled = math.ceil(0.15 * per_turn)
    found: list[Report] = [
        Ticks(round(1.2e9), 2 * per_turn, 2 * per_turn),
        Ticks(round(0.1e9), rolled, rolled),
    ]
    assert late_reads.times(found, [13.2, 13.2], None) == [13.2, 13.2]


@pytest.mark.parametrize(("per_turn", "rpm"), [(1, 20), (2, 10), (6, 3), (10, 2), (60, 2)])
def test_a_wheel_whose_ticks_are_rare_does_not_look_stalled(per_turn: int, rpm: int) -> None:
    """A wheel rolls at its set-point, but its ticks are rare. No stall is reported."""
    watch = StallWatch(LoisEcuSettings(ticks_per_revolution=per_turn))
    for now, ticks in reports([(0.2, float(rpm), float(rpm))] * 60, per_turn, "ms"):
        watch.wrote(SetRpm(rpm, rpm), now - 0.2)
        watch.heard(ticks, now)
        assert watch.stalled(now) == (False, False)


def test_a_new_resolution_applies_to_a_reset_in_progress() -> None:
    """A new resolution is set during a reset. The proof of the reset uses the new resolution.

    After the reset, a wheel has counted 250 ticks. This is few enough for the proof only by the new
    resolution: a quarter turn.
    """
    board = LoisEcuBoard(LoisEcuSettings(ticks_per_revolution=60))
    heading = encode_report(Heading(5))
    board.receive(encode_report(Ticks(1000, 9000, 9000)) + heading, 1.0)
    board.reset()
    board.settings = LoisEcuSettings(ticks_per_revolution=1000)
    found = board.receive(encode_report(Ticks(1200, 250, 240)) + heading, 1.2)
    assert ResetReading("") in found
