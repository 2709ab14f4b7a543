# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulator's codec, with bytes typed by hand from the manual."""

import pytest

from omnibot_driver.simulator.omnibot.wire import (
    ControlFrame,
    control_frame,
    delta_frame,
    imu_frame,
    paused_text,
    pose_frame,
)

APPENDIX = {
    "Stop": ("FF FE 02 00 00 00 00 00 00", 0x02, (0, 0, 0)),
    "E-stop": ("FF FE 10 00 00 00 00 00 00", 0x10, (0, 0, 0)),
    "Rotate all": ("FF FE 02 00 20 00 20 00 20", 0x02, (32, 32, 32)),
    "Rotate all reversed": ("FF FE 02 FF E0 FF E0 FF E0", 0x02, (-32, -32, -32)),
    "Rotate A": ("FF FE 02 00 20 00 00 00 00", 0x02, (32, 0, 0)),
    "Rotate B": ("FF FE 02 00 00 00 20 00 00", 0x02, (0, 32, 0)),
    "Rotate C": ("FF FE 02 00 00 00 00 00 20", 0x02, (0, 0, 32)),
    "Vx = 32": ("FF FE 01 00 20 00 00 00 00", 0x01, (32, 0, 0)),
    "Vy = 32": ("FF FE 01 00 00 00 20 00 00", 0x01, (0, 32, 0)),
    "Omega = 8": ("FF FE 01 00 00 00 00 00 08", 0x01, (0, 0, 8)),
}


@pytest.mark.parametrize(("typed", "mode", "values"), APPENDIX.values(), ids=APPENDIX.keys())
def test_each_command_of_the_appendix_is_understood(
    typed: str, mode: int, values: tuple[int, int, int]
) -> None:
    """The ten commands of the manual's appendix are decoded to the meaning printed there."""
    assert control_frame(bytes.fromhex(typed)) == ControlFrame(mode, values)


def test_commands_reach_the_whole_range_of_a_short() -> None:
    """The extremes +32,767 and -32,768 of a command value keep their sign and byte order."""
    frame = bytes.fromhex("FF FE 01 7F FF 80 00 FF FF")
    assert control_frame(frame) == ControlFrame(0x01, (32767, -32768, -1))


def test_the_imu_frame_is_laid_out_as_in_the_manual() -> None:
    """The IMU frame is FF FA, then accelerometer and gyro, most significant byte first."""
    sent = imu_frame((1, -2, 0x1234), (-6, -5, -4))
    assert sent == bytes.fromhex("FF FA 00 01 FF FE 12 34 FF FA FF FB FF FC")


def test_the_delta_frame_is_laid_out_as_in_the_manual() -> None:
    """The delta frame is FF FB, X_DIF, Y_DIF, TH_DIF, and SEQ in the ninth byte."""
    assert delta_frame((200, -200, 32767), 255) == bytes.fromhex("FF FB 00 C8 FF 38 7F FF FF")


def test_the_pose_frame_is_laid_out_as_in_the_manual() -> None:
    """The pose frame is FF FC, three floats with the most significant byte first, and SEQ."""
    sent = pose_frame(1000.0, -2.5, 1.0, 7)
    assert sent == bytes.fromhex("FF FC 44 7A 00 00 C0 20 00 00 3F 80 00 00 07")


def test_the_pose_frame_can_be_little_endian() -> None:
    """The manual does not make clear in which order the bytes of a pose's floats come.

    A setting selects the order with the least significant byte first.
    """
    sent = pose_frame(1000.0, -2.5, 1.0, 7, "little")
    assert sent == bytes.fromhex("FF FC 00 00 7A 44 00 00 20 C0 00 00 80 3F 07")


def test_the_paused_text_is_the_one_of_the_manual() -> None:
    """The text of a paused board has a space before its line feed."""
    assert paused_text(0) == b"Paused: 0 \n"
    assert paused_text(255) == b"Paused: 255 \n"
