# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of lines to a LOIS ECU in a drive: the LED's line is sent, settings may have to wait."""

import pytest
from lois_bench import FIRMWARE, Bench, configure

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.opening import SettingsWriter
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings


def switch_led(bench: Bench, on: bool) -> None:
    """Switch the LED as the node does when ``~/led`` is called."""
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    board.set_led(on, bench.now)
    bench.settle()


def drive_and_require_sleep(bench: Bench, seconds: float) -> None:
    """Drive for ``seconds``.

    At each step, check that the session needs its next wake-up later, not at once.
    """
    for step in range(round(seconds / 0.01)):
        if step % 10 == 0:
            bench.drive()
        bench.run(0.01)
        assert bench.session.wake_at > bench.now


@FIRMWARE
def test_the_led_is_switched_while_the_robot_drives(firmware: str) -> None:
    """The user switches the LED while the robot drives. The line is sent during the drive."""
    bench = Bench(firmware)
    bench.drive_on(0.3, 1.0)
    switch_led(bench, on=True)
    drive_and_require_sleep(bench, 1.0)
    assert bench.board.led


@pytest.mark.slow
@FIRMWARE
def test_an_unconfirmed_board_does_not_keep_the_pacer_awake(
    firmware: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot drives, and the board has not confirmed its settings.

    The session's next wake-up is always in the future, so the pacer does not run without a pause.
    """
    monkeypatch.setattr(SettingsWriter, "date_came", lambda _self: None)
    bench = Bench(firmware)
    bench.drive_on(0.3, 1.0)
    drive_and_require_sleep(bench, 3.0)


@FIRMWARE
def test_a_change_of_settings_keeps_the_led_line_that_waits(firmware: str) -> None:
    """The user switches the LED, and the driver sends several copies of the LED's line.

    The settings change when some copies are not sent yet. These copies are still sent.
    """
    bench = Bench(firmware)
    bench.hears = False
    switch_led(bench, on=True)
    configure(bench, LoisEcuSettings(low_pass=0.2))
    bench.hears = True
    bench.run(2.0)
    assert bench.board.led


def test_an_led_line_keeps_its_distance_from_the_motion_before_it() -> None:
    """While the robot drives, the LED's line comes at least 14.5 ms after a motion line.

    A board that misses bytes for 13 ms could otherwise join both to a wrong motion line.
    """
    bench = Bench("firmware")
    bench.drive_on(0.3, 1.0)
    switch_led(bench, on=True)
    moved_at, led_lines = bench.now, 0
    for step in range(200):
        bench.now += 0.005
        if step % 2 == 0:
            for channel, data in bench.robot.advance():
                bench.session.inbound.receive(data, bench.now, channel)
        if step % 4 == 0:
            bench.session.command_twist(BodyTwist(0.3 + step / 2000, 0.0, 0.0), bench.now)
        bench.session.tick(bench.now)
        before = len(bench.written)
        bench.settle()
        for line in b"".join(data for _, data in bench.written[before:]).splitlines():
            if line.startswith(b":02"):
                moved_at = bench.now
            if line.startswith(b":03"):
                led_lines += 1
                assert bench.now - moved_at > 0.0145
    assert led_lines == 5
