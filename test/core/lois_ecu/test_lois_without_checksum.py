# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a LOIS ECU that the user wants to drive without checksums (``checksum: false``)."""

from dataclasses import replace
from typing import Any

import pytest
from any_board import AnyBench, LoisRobot
from lois_bench import FIRMWARE, Bench
from lois_drives import HOST_GAINS, Rig, nominal

from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

BOOT_SHORT_CORRECTION = 1.0761719


@pytest.mark.slow
@FIRMWARE
def test_a_board_that_restarts_in_a_drive_is_told_again_to_expect_no_checksums(
    firmware: str,
) -> None:
    """A board that restarts in a drive verifies checksums again, and ignores lines without one.

    The driver sends a mode line with a checksum, which switches the checksums off. The robot then
    drives on.
    """
    bench = Bench(firmware, LoisEcuSettings(with_sum=False))
    bench.run(5.0)
    bench.drive_on(0.3, 3.0)
    bench.board.reboot()
    if firmware == "firmware":  # its boot takes 2 s, and the driver then refuses motion
        bench.run(2.2)
    bench.drive_on(0.3, 6.0)
    assert bench.board.truth.speed_mps > 0.1


@pytest.mark.slow
def test_settings_that_are_written_in_a_drive_keep_the_left_short_correction() -> None:
    """The driver writes the settings in a drive.

    The left short correction (a speed factor) keeps its value. Regression: the driver wrote the
    mode last, and this command also sets the factor to almost 0.
    """
    rig = Rig(nominal("firmware"), replace(HOST_GAINS, with_sum=False))
    rig.run(2.0)
    while not rig.driver._upkeep.writer.confirmed:
        rig.run(0.1)
        assert rig.now < 14.5
    rig.order(20, 20, 2.0)
    rig.driver.write_settings(rig.now)
    rig.order(20, 20, 3.0)
    assert rig.board.wheels[0].short_correction == pytest.approx(BOOT_SHORT_CORRECTION)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_lost_line_leaves_no_left_short_correction_of_zero(seed: int) -> None:
    """The driver writes the settings on a line that loses 1 % of the bytes.

    The command for the mode also sets a speed factor (left short correction) to almost 0. After the
    settings are written, this factor is right again.
    """
    rig = Rig(nominal("firmware", seed), replace(HOST_GAINS, with_sum=False), loss=0.01)
    rig.run(6.0)
    corrections = []
    for _ in range(5):
        rig.driver.write_settings(rig.now)
        rig.run(4.0)
        while not (rig.driver._upkeep.writer.done and rig.driver._upkeep.writer.confirmed):
            rig.run(0.1)
        corrections.append(rig.board.wheels[0].short_correction)
    assert corrections == pytest.approx([BOOT_SHORT_CORRECTION] * 5)


@FIRMWARE
def test_a_board_that_expects_checksums_unnoticed_drives_again_after_a_rest(firmware: str) -> None:
    """A board that works without checksums begins to expect them, and its wheels do not start.

    While the robot rests, a line with a checksum switches the checksums off again. The next drive
    succeeds.
    """
    bench = Bench(firmware, LoisEcuSettings(with_sum=False))
    bench.run(5.0)
    bench.board.receive(b":1100000000\n")
    bench.drive_on(0.3, 5.0)
    assert bench.board.standing
    bench.run(5.0)
    bench.drive_on(0.3, 3.0)
    assert not bench.board.standing


@FIRMWARE
@pytest.mark.parametrize("with_sum", [True, False])
@pytest.mark.parametrize("commands", [True, False])
def test_a_rolling_board_that_was_left_with_the_other_form_of_lines_is_stopped(
    firmware: str, *, with_sum: bool, commands: bool
) -> None:
    """A rolling board's checksum setting differs from the driver's when the port is opened.

    A Stop that the board obeys arrives within half a second, even if the user commands a motion.
    """
    lois = LoisRobot(firmware)
    board: Any = lois.board
    board.receive(b":233f80000066\n:020014001438\n" + (b":11000000043e\n" if with_sum else b""))
    bench = AnyBench(LoisEcuBoard(LoisEcuSettings(with_sum=with_sum)), lois)
    bench.run(2.0)
    assert board.truth.speed_mps > 0.1
    bench.open()
    for _ in range(5):
        if commands and bench.session.state == "nominal":
            bench.drive(-0.1)
        bench.run(0.1)
    assert (1, 0) in {(one.command, one.payload) for one in board.commands}
    bench.run(1.0)
    assert board.truth.speed_mps < 0.02
