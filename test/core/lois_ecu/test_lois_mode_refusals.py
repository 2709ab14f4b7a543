# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The reasons for which motion is refused while a mode of a LOIS ECU changes."""

from dataclasses import replace

import pytest
from lois_bench import FIRMWARE, Bench, configure, refusal, told

from omnibot_driver.core.lois_ecu import SetDuty, SetRpm, TerminalMode
from omnibot_driver.core.lois_ecu.readings import TerminalLeft
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.terminal import ModeChange

GPS = LoisEcuSettings(terminal_mode=TerminalMode.GPS)


@pytest.mark.slow
@FIRMWARE
def test_each_reason_for_a_refusal_appears_exactly_while_it_is_true(firmware: str) -> None:
    """The user sets a terminal mode, and later ends it.

    Refusals name the change of the mode, then the mode itself, and then the board that has not left
    the mode yet.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    configure(bench, GPS)
    assert "the robot is being stopped first" in refusal(bench)
    told_before, told_in_gps, told_after = set(), set(), set()
    while not any(b":1100000001" in data for _, data in bench.written):
        told_before.add(refusal(bench))
        bench.run(0.01)
    assert all(one.startswith("terminal_mode is changing to gps") for one in told_before)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    for _ in range(20):
        told_in_gps.add(refusal(bench))
        bench.run(0.1)
    assert told_in_gps == {
        "terminal_mode is gps, so the board reports no motion; set terminal_mode to host"
    }
    configure(bench, LoisEcuSettings())
    while not told(bench, TerminalLeft):
        told_after.add(refusal(bench))
        bench.run(0.05)
    assert told_after == {
        "the board has not left its terminal mode yet; wait until its reports arrive"
    }
    assert refusal(bench) == ""


def test_a_mode_that_is_not_written_yet_is_still_changing() -> None:
    """Refusals say that the terminal mode is still changing in two cases.

    * The robot is at rest, but the settings are not written yet.
    * The mode is written, but messages of the normal mode arrive.
    """
    change = ModeChange()
    change.want(TerminalMode.GPS)
    assert change.stops(0.0, stands=False, cleared=False) == SetDuty(0, 0)
    assert change.stops(0.1, stands=True, cleared=False) == SetRpm(0, 0)
    assert change.stops(0.2, stands=True, cleared=True) is None
    changing = "terminal_mode is changing to gps; set terminal_mode to host"
    assert change.due(0.2, settled=False) is None
    assert change.reason == changing
    assert change.due(1.0, settled=True) is TerminalMode.GPS
    assert change.reason.startswith("terminal_mode is gps, so the board reports no motion")
    change.protocol_heard(2.0)
    assert change.reason == changing


def test_a_terminal_mode_that_is_taken_back_refuses_no_motion() -> None:
    """The user sets a terminal mode, and takes it back before the driver has written it.

    The robot, which is already braking, stops, and then motion is allowed.
    """
    bench = Bench("documented")
    bench.drive_on(0.3, 1.0)
    configure(bench, GPS)
    bench.run(0.1)
    configure(bench, LoisEcuSettings())
    bench.run(2.0)
    assert bench.robot.stands
    assert refusal(bench) == ""
    assert bench.board.terminal_mode == 0


def test_a_terminal_mode_that_is_taken_back_does_not_end_another_stop() -> None:
    """The user changes the drive mode and the terminal mode, and takes the terminal mode back.

    The driver still stops the robot to change the drive mode. Refusals name only the drive mode.
    """
    bench = Bench("documented")
    bench.drive_on(0.3, 2.0)
    duty = LoisEcuSettings(drive_mode="duty")
    configure(bench, duty)
    configure(bench, replace(duty, terminal_mode=TerminalMode.GPS))
    both = "drive_mode is changing to duty and terminal_mode is changing to gps, and the robot"
    assert refusal(bench).startswith(both)
    configure(bench, duty)
    while reason := refusal(bench):
        assert (
            reason == "drive_mode is changing to duty, and the robot is being stopped first; wait"
        )
        bench.run(0.05)
    bench.run(0.5)
    assert not [line for line in bench.board.commands if line.command == 0x11]
