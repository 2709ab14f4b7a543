# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate step`` for a LOIS ECU: it finds unknown encoders, plants and gains.

A plant is what the controller controls: the motor with its wheel. A mark is a place on the
encoder's disc at which the board counts a tick.
"""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from omnibot_driver.boards.lois_ecu_records import save
from omnibot_driver.core.lois_ecu import (
    Record,
    RecordKind,
    SetRpm,
    Setting,
    WriteSetting,
    encode_command,
)
from omnibot_driver.core.lois_ecu.readings import RecordReading
from omnibot_driver.simulator.lois_ecu import (
    QUIRKS,
    Firmware,
    LoisSettings,
    MotorSettings,
    SimulatedLois,
)
from omnibot_driver.tools.calibrate.pi_loop import Loop, PiGains, answer, phase_margin_deg, traits
from omnibot_driver.tools.calibrate.pi_tuning import Goals, Tuned, dead_time_s, told, tune
from omnibot_driver.tools.calibrate.tick_fit import Column, Plant, fit, speed
from omnibot_driver.tools.calibrate.tick_marks import marks_in
from omnibot_driver.tools.calibrate.tick_records import levels, read
from omnibot_driver.tools.calibrate.tick_search import turned
from omnibot_driver.tools.needs import ToolError

TICKS = 60
LOOP = Loop(0.091, TICKS)
PLANT = Plant(0.66, 0.3, 0.1, 6.0)


@cache
def tuned() -> Tuned:
    """Return the gains that the tool finds for ``PLANT`` with its usual goals."""
    return tune(PLANT, LOOP, Goals())


def starts(plant: Plant, count: int, ticks: int = 150, seed: int = 1) -> list[Column]:
    """Return simulated records of a wheel that starts at full duty.

    A record has the times in s between the marks of the wheel's encoder. The simulated marks are
    displaced at random.
    """
    random = np.random.default_rng(seed)
    times_s = np.arange(0.0, 6.0, 1e-4)
    way = plant.final_rpm(100.0) * TICKS / 60 * turned(times_s, plant.slow_s, plant.fast_s)
    off = 0.07 * random.standard_normal(TICKS)
    found = []
    for _ in range(count):
        marks = random.random() + np.arange(ticks)
        marks += off[(np.arange(ticks) + random.integers(TICKS)) % TICKS]
        at_s = np.interp(marks, way, times_s)
        found.append(np.round(np.diff(at_s, prepend=-1.0), 4))
    return found


@pytest.mark.parametrize("fast_s", [0.0, 0.1, 0.3])
def test_a_plants_speed_is_the_change_of_its_way(fast_s: float) -> None:
    """The function ``speed`` is the time derivative of the function ``turned``.

    This also holds for a plant of first order (``fast_s`` is 0) and for two equal time constants.
    """
    times_s = np.linspace(0.0, 3.0, 3001)
    slope = np.gradient(turned(times_s, 0.3, fast_s), times_s)
    assert slope[1:-1] == pytest.approx(speed(times_s, 0.3, fast_s)[1:-1], abs=2e-3)
    assert speed(times_s, 0.3, fast_s)[-1] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("slow_s", [0.2, 0.45])
def test_a_plant_is_found_in_how_ticks_follow_each_other(slow_s: float) -> None:
    """The encoder's marks are misplaced, which changes the times between ticks by 10 %.

    The fit still finds a second-order plant.
    """
    planted = Plant(0.62, slow_s, 0.4 * slow_s, 5.0)
    found = fit(starts(planted, 8), TICKS)
    assert found.order == 2
    assert found.slow_s == pytest.approx(slow_s, rel=0.1)
    assert found.fast_s == pytest.approx(0.4 * slow_s, abs=3 * found.sigmas[2])
    assert found.final_rpm == pytest.approx(planted.final_rpm(100.0), rel=0.005)
    assert found.slow_s == pytest.approx(slow_s, abs=4 * found.sigmas[1])


def test_marks_that_come_again_in_each_turn_are_found_and_do_not_blur_the_plant() -> None:
    """The encoder's marks are misplaced, which changes the times between ticks by 10 %.

    The fit finds the displacements of the marks, and the plant.
    """
    found = fit(starts(PLANT, 8), TICKS)
    assert found.marks is not None
    assert np.std(found.marks.steps) == pytest.approx(0.1, abs=0.02)
    assert found.rms < 0.01
    assert found.fast_s == pytest.approx(PLANT.fast_s, rel=0.05)


def test_noise_that_does_not_come_again_is_not_taken_for_marks() -> None:
    """The encoder's marks are evenly spaced, and the times between ticks have only random noise.

    The tool finds no misplaced marks.
    """
    random = np.random.default_rng(4)
    assert marks_in([0.1 * random.standard_normal(120) for _ in range(24)], TICKS) is None
    assert marks_in([np.zeros(120)] * 24, TICKS) is None


def test_marks_that_were_missed_or_timed_late_cost_little() -> None:
    """While the public firmware sends data, it misses some ticks and notices others too late.

    These two errors hardly change the fit.
    """
    records = starts(PLANT, 8)
    for number, record in enumerate(records):
        late, missed = 30 + 5 * number, 60 + 7 * number
        record[late] += 0.008
        record[late + 1] -= 0.008
        records[number] = np.concatenate(
            (record[:missed], [record[missed : missed + 2].sum()], record[missed + 2 :])
        )
    found = fit(records, TICKS)
    assert found.marks is not None
    assert found.rms < 0.01
    assert found.slow_s == pytest.approx(PLANT.slow_s, rel=0.03)
    assert found.fast_s == pytest.approx(PLANT.fast_s, rel=0.05)


def test_records_that_are_too_short_are_refused() -> None:
    """The records are too short. The error names ``--samples``, which sets their length."""
    with pytest.raises(ToolError, match="increase --samples"):
        fit([one[:20] for one in starts(PLANT, 3)], TICKS)


@pytest.mark.parametrize("begins", [0, 1])
def test_the_levels_of_an_encoder_are_found_whichever_comes_first(begins: int) -> None:
    """Short and long ticks alternate, and the board has missed some edges.

    The tool finds a correction factor for short ticks, and one for long ticks.
    """
    random = np.random.default_rng(2)
    ticks_s = 0.03 * np.tile([0.93, 1.07], 150)[begins:] * random.normal(1.0, 0.05, 300 - begins)
    ticks_s[[40, 41, 120]] *= 2.0
    found = levels(ticks_s, TICKS)
    assert found.short == pytest.approx(1 / 0.93, abs=0.01)
    assert found.long == pytest.approx(1 / 1.07, abs=0.01)
    assert found.rpm == pytest.approx(60 / (0.03 * TICKS), rel=0.02)


@pytest.mark.parametrize(("margin", "overshoot"), [(None, 0.02), (None, 0.1), (60.0, 0.02)])
def test_gains_keep_to_their_goals(margin: float | None, overshoot: float) -> None:
    """The tuned gains meet the goals for overshoot and phase margin.

    Tn compensates the slow pole. Without a goal for the phase margin, Td is 0.
    """
    goals = Goals(overshoot=overshoot, phase_margin_deg=margin)
    found = tune(PLANT, LOOP, goals)
    assert found.gains.tn_s == pytest.approx(PLANT.slow_s * 0.2 / 0.091)
    assert found.overshoot <= overshoot
    assert math.isfinite(found.settled_s)
    if margin is None:
        assert found.gains.td_s == 0.0
    else:
        assert found.phase_margin_deg >= margin


@pytest.mark.parametrize("plant", [Plant(0.7, 0.2, 0.06, 7.0), Plant(0.6, 0.45, 0.2, 3.0)])
def test_on_a_board_that_sends_meanwhile_hardly_a_step_overshoots_much_more(plant: Plant) -> None:
    """Without data from the board, the overshoot of a step is at most 5 %.

    If the board sends data during the step, 95 % of the overshoots are below 8 %, all below 9 %.
    """
    loop = replace(LOOP, dead_s=0.02)
    found = tune(plant, loop, Goals(phase_margin_deg=60.0))
    assert found.overshoot <= 0.05
    begun, sent_s = np.meshgrid(np.arange(0.0, 1.0, 0.1), np.arange(0.0, 0.2, 0.02))
    rpm = answer(plant, found.gains, loop, found.target_rpm, 4.0, begun=begun, sent_s=sent_s)
    overshoots = traits(rpm, found.target_rpm, 0.05).overshoot
    assert found.overshoot + 0.005 < overshoots.max() < 0.09
    assert np.quantile(overshoots, 0.95) < 0.08


def test_a_board_that_sends_when_the_step_is_over_disturbs_nothing() -> None:
    """A board that sends its tick counts during a step changes the step's response.

    If it sends them after the step, the response stays the same.
    """
    loop, gains = replace(LOOP, sends_each_s=100.0), PiGains(0.8, 0.6, 0.1)
    calm = answer(PLANT, gains, loop, 31.0, 3.0)
    late = answer(PLANT, gains, loop, 31.0, 3.0, sent_s=np.arange(50.0, 49.9, -0.01))
    assert (late == calm[:, None]).all()
    early = answer(PLANT, gains, loop, 31.0, 3.0, sent_s=np.arange(1.0, 1.1, 0.01))
    assert (early != calm[:, None]).any()


def test_goals_that_nothing_meets_are_told() -> None:
    """The plant is faster than its controller, so no gains meet the goals.

    The tool reports an error.
    """
    slow = Loop(1.0, TICKS, 0.5)
    with pytest.raises(ToolError, match="allow more"):
        tune(Plant(0.66, 0.02, 0.0), slow, Goals(overshoot=0.0, band=0.001, phase_margin_deg=89.9))


def test_a_phase_margin_is_that_of_the_open_loop() -> None:
    """The phase margin agrees with that of a simple open loop, calculated by hand.

    Without lags, the open loop is Kp K / (s Tn). Its gain is 1 at the frequency Kp K / Tn.
    """
    loop = Loop(1e-6, 10**9, nominal_s=1e-6)
    plant = Plant(1.0, 0.5, 0.0)
    margin = phase_margin_deg(plant, PiGains(1.0, 0.5, 0.0), loop, 1000.0)
    assert float(margin) == pytest.approx(90.0, abs=1.0)
    late = phase_margin_deg(
        plant, PiGains(1.0, 0.5, 0.0), Loop(1e-6, 10**9, 0.2, nominal_s=1e-6), 1000.0
    )
    assert float(late) == pytest.approx(90.0 - math.degrees(2.0 * 0.2), abs=1.5)


def test_a_dead_time_is_found_in_the_answer_to_a_step() -> None:
    """A wheel's response to a step has a dead time of 40 ms.

    The fit finds this dead time with an error of at most 11 ms.
    """
    gains = tuned().gains
    dead_s = 0.04
    rpm = answer(PLANT, gains, Loop(0.091, TICKS, dead_s), 31.0, 4.0, begun=0.6)
    ticks = 0.6 + np.cumsum(rpm) * 1e-3 * TICKS / 60
    at_s = np.interp(np.arange(1.0, ticks[-1]), ticks, 1e-3 * np.arange(1, len(ticks) + 1))
    found = dead_time_s([(PLANT, LOOP, [(gains, 31.0, [np.diff(at_s, prepend=0.0)])])])
    assert found == pytest.approx(dead_s, abs=0.011)


@pytest.mark.parametrize("gains", [PiGains(1.2, 0.6, 0.1), PiGains(0.44, 0.29, 0.65)])
@pytest.mark.parametrize("firmware", QUIRKS)
def test_a_step_is_predicted_as_the_simulated_board_makes_it(
    firmware: Firmware, gains: PiGains
) -> None:
    """For each firmware, the tool's prediction of a step agrees with the step of a simulated board.

    The firmwares run their controllers at different rates: 11 or 5 times a second.
    """
    motor = MotorSettings(
        rpm_per_percent=0.66,
        dead_zone_percent=6.0,
        time_constant_s=0.3,
        second_time_constant_s=0.1,
    )
    board = SimulatedLois(LoisSettings(quirks=QUIRKS[firmware], running=True, motors=(motor,) * 2))
    for setting, value in (
        (Setting.RPM_LOW_PASS, 1.0),
        (Setting.LEFT_KP, gains.kp),
        (Setting.LEFT_TN, gains.tn_s),
        (Setting.LEFT_TD, gains.td_s),
    ):
        for _ in range(4):
            board.receive(encode_command(WriteSetting(setting, float(value))))
            board.step()
    for _ in range(3):
        board.receive(encode_command(SetRpm(31, 31)))
        board.step()
    shown = []
    for _ in range(350):
        shown.append(board.motors[0].rpm)
        board.step()
    told_rpm = answer(
        PLANT, gains, Loop(0.091 if firmware == "firmware" else 0.2, TICKS), 31.0, 3.0
    )
    begins = next(place for place, rpm in enumerate(shown) if rpm > 0.1)
    told_rpm = told_rpm[int(np.argmax(told_rpm > 0.1)) :: 10][:250]
    off = np.array(shown[begins : begins + len(told_rpm)]) - told_rpm
    assert np.sqrt(np.mean(off**2)) < 1.5


def test_traits_of_an_answer_are_read_off_it() -> None:
    """The function ``traits`` finds overshoot and settling time of a decaying oscillation."""
    times_s = np.arange(0.0, 4.0, 1e-3)
    rpm = 40.0 * (1 - np.exp(-3 * times_s) * np.cos(6 * times_s))
    found = traits(rpm, 40.0, 0.05)
    assert float(found.overshoot) == pytest.approx(math.exp(-math.pi / 2) * 1.118, abs=0.03)
    last = times_s[np.abs(rpm - 40.0) > 2.0][-1]
    assert float(found.settled_s) == pytest.approx(last, abs=2e-3)


def test_a_record_that_the_board_could_not_tell_is_refused(tmp_path: Path) -> None:
    """All times in a record are the largest possible: 6.6 ms in the manual's unit of 100 ns.

    The tool refuses the record, because the true times may be longer.
    """
    record = Record(RecordKind.RPM, (0xFFFF,) * 50, (0xFFFF,) * 50)
    path = tmp_path / "rpm.csv"
    save(RecordReading(record, 1e-7, TICKS), path)
    with pytest.raises(ToolError, match="152 RPM"):
        read(path)


def test_a_record_with_a_damaged_cell_is_refused(tmp_path: Path) -> None:
    """A cell of the file is not a number. The error names the file."""
    path = tmp_path / "rpm.csv"
    path.write_text("left_tick_s,right_tick_s\n0.01,0.0x\n")
    with pytest.raises(ToolError, match=r"rpm.csv cannot be read"):
        read(path)


def test_what_is_worse_than_before_is_told_as_it_is() -> None:
    """The tool predicts a larger control error for slow gains than for tuned gains."""
    good = tuned().gains
    slow = PiGains(0.05, 2.0, 1.0)
    assert told(PLANT, slow, LOOP, Goals()).error_s > told(PLANT, good, LOOP, Goals()).error_s
