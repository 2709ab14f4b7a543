# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry of a LOIS ECU with reports, commands, restarts and new connections in any order."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    SetDuty,
    SetRpm,
    Ticks,
    encode_command,
    encode_report,
)
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.translation import Translation

WAITS_S = st.sampled_from([0.0, 0.001, 0.01, 0.2, 0.7, 5.0])
GROUPS = st.builds(
    BoardOdometry,
    *(st.floats(-5, 5) for _ in range(6)),
    appended=st.booleans(),
)
HAPPENINGS = st.one_of(
    st.sampled_from(["connect", "restart", "restart of unknown time", "reset", "halt"]),
    st.builds(SetRpm, st.integers(-50, 50), st.integers(-50, 50)),
    st.builds(SetDuty, st.integers(-100, 100), st.integers(-100, 100)),
    st.builds(Ticks, st.just(0), st.integers(0, 60), st.integers(0, 60)),
    GROUPS,
)


def happen(odometry: LoisOdometry, what: object, now: float) -> None:
    if isinstance(what, Ticks):
        odometry.heard_ticks(what, now)
    elif isinstance(what, BoardOdometry):
        odometry.heard_odometry(what, now)
    elif isinstance(what, SetRpm | SetDuty):
        odometry.wrote(what, now)
    elif what == "connect":
        odometry.connect()
    elif what == "reset":
        odometry.reset()
    elif what == "halt":
        odometry.halted(now)
    else:
        odometry.restarted(now, 1.0 if what == "restart" else None)


@pytest.mark.slow
@given(st.lists(st.tuples(WAITS_S, HAPPENINGS), max_size=30))
def test_whatever_happens_the_pose_stays_a_number(events: list[tuple[float, object]]) -> None:
    """Reports, commands, restarts and connections come in random order. The pose stays finite."""
    odometry, now = LoisOdometry(LoisEcuSettings()), 1000.0
    for wait_s, what in events:
        now += wait_s
        happen(odometry, what, now)
        predicted = odometry.predict(now)
        if predicted is not None:
            assert predicted.pose.finite
            assert math.isfinite(predicted.twist.vx_mps + predicted.twist.yaw_rate_radps)
            assert min(predicted.covariance.xx, predicted.covariance.yy) >= 0.0


def test_the_first_group_behind_a_new_connection_lasts_as_long_as_it_took() -> None:
    """The driver reconnects, and the robot starts backward between the first two odometry reports.

    The driver knows the time between these two reports, so the covariance of the estimated pose
    stays finite.
    """
    odometry = LoisOdometry(LoisEcuSettings())
    group = BoardOdometry(0.1, 0.1, 0.3, 0.0, 0.0, 0.0, appended=True)
    odometry.heard_ticks(Ticks(0, 16, 35), 9.1)
    odometry.heard_odometry(group, 9.2)
    odometry.connect()
    odometry.heard_odometry(group, 10.0)
    odometry.heard_ticks(Ticks(0, 16, 35), 10.1)
    odometry.wrote(SetRpm(-20, -20), 10.11)
    odometry.heard_odometry(group, 10.2)
    (estimate,) = odometry.heard_ticks(Ticks(200, 16, 36), 10.3)
    assert math.isfinite(estimate.covariance.xx)


def test_counts_that_a_reset_cleared_while_the_wheels_roll_out_are_no_backward_motion() -> None:
    """The driver resets the board while the wheels roll out, and the tick counts fall from 5 to 3.

    The driver does not take this fall for backward motion.
    """
    translation = Translation(LoisEcuSettings())
    translation.reset()
    translation.readings([Ticks(1000, 5, 5)], [10.0], "ms", 10.0)
    translation.readings([Ticks(1200, 3, 3)], [10.2], "ms", 10.2)
    assert not translation.odometry._motion.signed
    assert translation.counts.last == Ticks(1200, 3, 3)


@pytest.mark.parametrize("restarted", [True, False])
def test_after_a_silence_the_clock_tells_a_restart_from_wheels_that_rolled_back(
    *, restarted: bool
) -> None:
    """The board is silent, and its tick counts are then zero.

    If the board's clock has begun at zero, too, the driver counts a restart and keeps the pose.
    Otherwise, the pose moves back.
    """
    ours = LoisEcuSettings()
    driver, now, place_m = LoisConversation(ours), 0.0, []

    def hear(board_s: float, ticks: int) -> None:
        counts = round(board_s * 1e9) % (1 << 32)
        driver.receive(encode_report(Ticks(counts, ticks, ticks)), now)
        driver.receive(b"", now + 0.1)
        if predicted := driver.predicted(now + 0.1):
            place_m.append(predicted.pose.x_m)

    driver.wrote(encode_command(SetRpm(50, 50)), -1.0)
    for step in range(61):
        now = 0.2 * step
        if step == 50:
            driver.wrote(encode_command(SetDuty(0, 0)), now)
        hear(7.0 + now, 10 * min(step, 50))
    driver.silence()
    before_m = place_m[-1]
    assert before_m > 400 * ours.tick_m
    for step in range(10):
        now = 24.0 + 0.2 * step
        hear(0.2 * (step + 1) if restarted else 7.0 + now, 0)
    assert (abs(place_m[-1] - before_m) < 0.1) is restarted
    assert driver.translation.counts.restarts == restarted
