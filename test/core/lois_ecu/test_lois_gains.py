# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The notice about controller gains that the user has not set, so that the board uses its own."""

from dataclasses import replace

import pytest
from any_board import AnyBench, LoisRobot
from lois_drives import HOST_GAINS

from omnibot_driver.core.events import Notice
from omnibot_driver.core.lois_ecu import Setting
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings


def opened(settings: LoisEcuSettings) -> AnyBench:
    bench = AnyBench(LoisEcuBoard(settings), LoisRobot("firmware"))
    bench.open()
    bench.run(10.0)
    return bench


def told(bench: AnyBench) -> list[str]:
    """Return the notices about gains that are not set."""
    notices = [event.text for event in bench.events if isinstance(event, Notice)]
    return [sentence for sentence in notices if "board's own" in sentence]


def test_the_boards_own_gains_are_told_once_with_what_follows() -> None:
    """The user has set no gains. One notice reports that the board uses its own gains.

    The diagnostics name the missing gains until the user has set them.
    """
    bench = opened(LoisEcuSettings())
    (sentence,) = told(bench)
    assert "0.16 m in nearly all drives, and by 2.2 m in one of 150. Run `calibrate" in sentence
    assert bench.session.board.figures.own["Gains"].startswith(
        "left_kp, left_tn, left_td, right_kp"
    )


@pytest.mark.slow
def test_gains_that_are_set_need_no_words() -> None:
    """The notice names only gains that are not set, and does not appear if all are set."""
    assert told(opened(HOST_GAINS)) == []
    written = {name: one for name, one in HOST_GAINS.written.items() if name != Setting.RIGHT_TN}
    (sentence,) = told(opened(replace(HOST_GAINS, written=written)))
    assert "the board's own right_tn." in sentence


def test_without_a_speed_controller_its_gains_do_not_matter() -> None:
    """Duty commands bypass the speed controllers. The notice does not appear."""
    assert told(opened(LoisEcuSettings(drive_mode="duty"))) == []
