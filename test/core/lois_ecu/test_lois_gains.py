# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of controller gains: how they reach the board, and the notice about missing gains."""

import math
from dataclasses import replace

import pytest
from any_board import AnyBench, LoisRobot
from lois_bench import Bench
from lois_drives import HOST_GAINS

from omnibot_driver.core.events import Notice
from omnibot_driver.core.lois_ecu import SetRpm, Setting, encode_command
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.opening import ROUNDS, SettingsWriter
from omnibot_driver.core.lois_ecu.outbound import STOP
from omnibot_driver.core.lois_ecu.set_points import SetPoints
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.upkeep import Upkeep

OTHER_STOP = b":0100000000\n"
"""Stop without a checksum, which a board that verifies checksums ignores."""


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
    """If the user has set no gains, one notice says that the board uses its own gains.

    The diagnostics name the missing gains until the user has set them.
    """
    bench = opened(LoisEcuSettings())
    (sentence,) = told(bench)
    assert "0.16 m in nearly all drives, and by 2.2 m in one of 150" in sentence
    assert "Run `calibrate step`, or set these parameters" in sentence
    assert bench.session.board.figures.own["Gains"].startswith(
        "left_kp, left_tn, left_td, right_kp"
    )


@pytest.mark.slow
def test_gains_that_are_set_need_no_words() -> None:
    """The notice about missing gains names only the gains that the user has not set.

    It does not appear if all gains are set.
    """
    assert told(opened(HOST_GAINS)) == []
    written = {name: one for name, one in HOST_GAINS.written.items() if name != Setting.RIGHT_TN}
    (sentence,) = told(opened(replace(HOST_GAINS, written=written)))
    assert "the board's own right_tn." in sentence


def test_without_a_speed_controller_its_gains_do_not_matter() -> None:
    """Duty commands bypass the speed controllers. No notice about missing gains appears."""
    assert told(opened(LoisEcuSettings(drive_mode="duty"))) == []


@pytest.mark.slow
def test_settings_that_a_busy_computer_writes_together_reach_the_board() -> None:
    """A busy computer sends many settings without a pause, and all reach the board.

    Each of the driver's rounds requests a GPS date only after its last setting, because the board
    receives nothing while it sends a date.
    """
    writer, robot = SettingsWriter(HOST_GAINS, SetPoints(HOST_GAINS)), LoisRobot("firmware")
    writer.begin(0.0)
    for count in range(ROUNDS):
        robot.board.receive(writer.due(float(count)))
        robot.board.receive(writer.due(count + 0.9))
        for _ in range(100):
            robot.advance()
    left, right = (wheel.controller.gains for wheel in robot.board.wheels)
    assert left.low_pass == right.low_pass == pytest.approx(HOST_GAINS.low_pass)
    assert left.kp == pytest.approx(HOST_GAINS.written[Setting.LEFT_KP])
    assert right.td == pytest.approx(HOST_GAINS.written[Setting.RIGHT_TD])


def test_no_line_follows_the_request_for_a_date_directly() -> None:
    """After a request for a date, the driver waits at least 20 ms before the next line.

    The board receives nothing while it sends the date.
    """
    writer = SettingsWriter(HOST_GAINS, SetPoints(HOST_GAINS))
    writer.begin(0.0)
    sent: list[tuple[float, bytes]] = []
    now = 0.0
    while not writer.done:
        now = max(now, writer.wake_at)
        sent.append((now, writer.due(now)))
    asked = [index for index, (_, data) in enumerate(sent) if data.startswith(b":0f0000fffe")]
    assert len(asked) == ROUNDS
    assert all(sent[index + 1][0] - sent[index][0] >= 0.0199 for index in asked[:-1])
    own = [data for _, data in sent if data != OTHER_STOP]
    assert len(own) == len(sent) - ROUNDS
    assert all(len(data) == 14 for data in own)


@pytest.mark.parametrize("reads_s", [0.001, 0.01, 0.07])
def test_no_setting_follows_a_set_point_directly(reads_s: float) -> None:
    """A driver that is called often enough sends each setting at least 15 ms after a Stop.

    Otherwise, lost characters could join a Stop and a setting to a command of full duty.
    """
    points = SetPoints(HOST_GAINS)
    writer = SettingsWriter(HOST_GAINS, points)
    writer.begin(0.0)
    now, stopped_at_s, followed = 0.0, -math.inf, []
    while not writer.done:
        assert now < 10.0
        if now >= stopped_at_s + 0.05:
            stopped_at_s = now
            points.wrote(encode_command(STOP), now)
        if now >= writer.wake_at and writer.due(now):
            followed.append(now - stopped_at_s)
        now += reads_s
    assert min(followed) >= (0.0149 if reads_s < 0.05 else 0.0)


@pytest.mark.parametrize("waited_s", [0.1, 5.0])
def test_no_setting_that_waited_for_a_stop_follows_it_directly(waited_s: float) -> None:
    """A drive ends with repeated Stops, while a setting waits.

    The setting is sent after 15 ms without a Stop, or at the latest 0.5 s after the first Stop.
    """
    settings = LoisEcuSettings()
    points = SetPoints(settings)
    writer = SettingsWriter(settings, points)
    writer.begin(0.0)
    now = 0.0
    while not writer.done:
        writer.due(now)
        now += 0.01
    points.wrote(encode_command(SetRpm(20, 20)), now)
    writer.repeat(now)
    now += waited_s
    assert not writer.due(now)
    points.wrote(encode_command(STOP), now)
    assert writer.wake_at == pytest.approx(now + 0.015)
    assert not writer.due(now)
    for count in range(1, 11):
        points.wrote(encode_command(STOP), now + 0.05 * count)
        assert bool(writer.due(now + 0.05 * count)) == (count == 10)


@pytest.mark.parametrize("with_sum", [True, False])
def test_a_recovery_that_waited_for_a_stop_follows_it_after_a_pause(with_sum: bool) -> None:
    """In a long drive, the board does not answer, and seems to have left its normal mode.

    The driver waits for the Stop, and 15 ms later writes only the lines that restore the mode.
    """
    settings = LoisEcuSettings(with_sum=with_sum)
    points = SetPoints(settings)
    upkeep = Upkeep(settings, points)
    points.wrote(encode_command(SetRpm(20, 20), with_sum=with_sum), 0.0)
    for count in range(600):
        upkeep.due(0.01 * count, stands=False)
    upkeep.writer.repeat(6.0)
    points.wrote(encode_command(STOP, with_sum=with_sum), 6.0)
    assert upkeep.wake_at == pytest.approx(6.015)
    assert not upkeep.due(6.0, stands=False)
    assert upkeep.due(6.016, stands=False) == upkeep.writer.recovery()


def test_a_stop_in_the_other_form_is_written_alone() -> None:
    """The driver also sends Stop without a checksum, but never in one write with a setting.

    If Stop and the setting lost characters in one write, the remaining characters could command
    full duty.
    """
    writer = SettingsWriter(HOST_GAINS, SetPoints(HOST_GAINS))
    writer.begin(0.0)
    sent = [writer.due(0.3 * count) for count in range(40)]
    assert sent.count(OTHER_STOP) == ROUNDS
    assert all(data == OTHER_STOP or OTHER_STOP not in data for data in sent)


@pytest.mark.slow
def test_a_wheel_that_does_not_start_gets_its_settings_again_at_rest() -> None:
    """The board has lost its low-pass gain, so the wheels do not turn.

    The driver writes the settings again at rest. The next drive moves the robot.
    """
    bench = Bench("firmware", HOST_GAINS)
    bench.run(1.0)
    for wheel in bench.board.wheels:
        wheel.controller.change(low_pass=0.0)
    before = len(bench.written)
    bench.drive_on(0.3, 4.0)
    assert bench.board.standing
    assert not any(data.startswith(b":23") for _, data in bench.written[before:])
    bench.run(3.0)
    bench.drive_on(0.3, 3.0)
    assert not bench.board.standing
