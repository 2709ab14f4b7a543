# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The covariance after set-points that change their sign in quick succession."""

import pytest
from lois_drives import HOST_GAINS

from omnibot_driver.core.lois_ecu import BoardOdometry, SetRpm, Ticks, motion_filter
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings


def variance(settings: LoisEcuSettings, holds_s: float) -> float:
    """Return the yaw variance in rad² after three set-points of alternating sign.

    ``holds_s``: time from one set-point to the next, in s.
    """
    odometry = LoisOdometry(settings)
    group = BoardOdometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, appended=True)
    now, rpm, turned_s = 0.0, 20, 1.0
    for step in range(round((3 * holds_s + 1.0) / 0.2)):
        now = 0.2 * step
        odometry.heard_ticks(Ticks(200 * step, 0, 0), now)
        if step < 4:
            odometry.heard_odometry(group, now + 0.01)
        if now >= turned_s:
            rpm, turned_s = -rpm, turned_s + holds_s
            odometry.wrote(SetRpm(rpm, rpm), now)
    told = odometry.predict(now)
    assert told is not None
    return told.covariance.yaw_yaw


def test_a_change_of_sign_soon_after_another_is_doubted_more_with_the_boards_own_gains() -> None:
    """The set-points change their sign twice in quick succession, so the wheels have not settled.

    With the board's own gains, this makes the yaw variance larger than with the user's gains.
    """
    assert variance(LoisEcuSettings(), 0.6) > 1.5 * variance(HOST_GAINS, 0.6)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [LoisEcuSettings(), HOST_GAINS], ids=["own", "set"])
def test_a_wheel_that_has_settled_is_not_doubted(
    settings: LoisEcuSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sign change of the set-points adds yaw variance only if it comes soon after another one."""
    soon, late = variance(settings, 0.6), variance(settings, 7.0)
    monkeypatch.setattr(motion_filter, "UNSETTLED_S", (0.0, 0.0))
    assert soon > 1.02 * variance(settings, 0.6)
    assert late == pytest.approx(variance(settings, 7.0), rel=1e-3)
