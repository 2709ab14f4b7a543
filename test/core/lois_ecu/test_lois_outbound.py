# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Lines to a LOIS ECU lose characters. Test that a short loss never makes another valid line."""

from collections.abc import Iterator
from itertools import combinations

import pytest

from omnibot_driver.core.lois_ecu import (
    DistributeBall,
    Reset,
    SetDuty,
    SetLed,
    SetPeriod,
    SetRpm,
    Setting,
    Stream,
    WriteSetting,
    encode_command,
)
from omnibot_driver.core.lois_ecu.messages import Command
from omnibot_driver.core.lois_ecu.opening import SettingsWriter
from omnibot_driver.core.lois_ecu.outbound import set_points
from omnibot_driver.core.lois_ecu.set_points import SetPoints
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu.wire import LineReader

STOP, CLEAR = SetDuty(0, 0), SetRpm(0, 0)
STOPPED = (1, 0)
MODE, WITHOUT_SUM = 0x11, 4
TALKS: dict[str, list[Command]] = {
    "stop behind motion": [SetRpm(17, 17), STOP, STOP],
    "start": [CLEAR, SetRpm(18, 18), CLEAR, SetRpm(18, 18)],
    "ramp": [SetRpm(20, 20), SetRpm(21, 20), SetRpm(21, 22)],
    "turn": [SetRpm(-1, 1), SetRpm(-256, 255), SetRpm(20, -20)],
    "emergency stop": [SetRpm(50, -50), CLEAR, STOP, CLEAR, STOP],
    "duty": [SetDuty(100, -100), SetDuty(3, 3), STOP],
    "settings": [
        WriteSetting(Setting.RPM_LOW_PASS, 1.0),
        SetPeriod(Stream.TICKS, 200),
        Reset(),
        DistributeBall(),
    ],
}


def heard(data: bytes, *, with_sum: bool, lenient: bool) -> list[tuple[int, int]]:
    """Return the command number and the payload of each line that the firmware accepts."""
    reader = LineReader(lenient=lenient)
    reader.checks = with_sum
    return list(reader.take_all(data))


def losses(length: int, most: int) -> Iterator[tuple[int, ...]]:
    """Yield each possible loss of up to ``most`` characters from a text of ``length`` characters.

    A loss is given by the positions of the lost characters.
    """
    for count in range(most + 1):
        yield from combinations(range(length), count)


@pytest.mark.slow
@pytest.mark.parametrize("name", TALKS)
@pytest.mark.parametrize("with_sum", [True, False], ids=["with sum", "without"])
def test_no_loss_of_up_to_two_characters_makes_another_line(name: str, with_sum: bool) -> None:
    """If up to two characters are lost, the firmware accepts only lines that the driver sent.

    Only lenient firmware is tested, because it accepts every line that strict firmware accepts.
    """
    data = b"".join(encode_command(command, with_sum=with_sum) for command in TALKS[name])
    said = heard(data, with_sum=with_sum, lenient=True)
    assert len(said) == len(TALKS[name])
    for lost in losses(len(data), 2):
        rest = bytes(byte for at, byte in enumerate(data) if at not in lost)
        found = heard(rest, with_sum=with_sum, lenient=True)
        remaining = iter(said)
        assert all(line in remaining for line in found), lost


@pytest.mark.parametrize("with_sum", [True, False], ids=["with sum", "without"])
def test_settings_that_lose_up_to_two_characters_never_command_a_motion(with_sum: bool) -> None:
    """Lines of settings and modes lose up to two characters on the way to the board.

    The board, which expects no checksums at first, never finds a motion command in the rest.
    """
    settings = LoisEcuSettings(with_sum=with_sum)
    writer = SettingsWriter(settings, SetPoints(settings))
    writer.begin(0.0)
    data = b"".join(writer.due(step / 100) for step in range(40)) + writer.recovery()
    for lost in losses(len(data), 2):
        if lost and lost[-1] - lost[0] < 28:
            rest = bytes(byte for at, byte in enumerate(data) if at not in lost)
            reader = LineReader(lenient=True)
            reader.checks = False
            for character in rest:
                command, payload = reader.take(character) or STOPPED
                assert command not in (1, 2) or not payload, lost
                if command == MODE:
                    reader.checks = payload != WITHOUT_SUM


@pytest.mark.parametrize("with_sum", [True, False], ids=["with sum", "without"])
def test_no_run_of_fewer_characters_than_a_line_makes_another_line(with_sum: bool) -> None:
    """Adjacent characters of one line, or of two successive lines, are lost: fewer than a line has.

    The remaining characters never form another valid line.
    """
    length = 14 if with_sum else 12
    for talk in TALKS.values():
        data = b"".join(encode_command(command, with_sum=with_sum) for command in talk)
        said = heard(data, with_sum=with_sum, lenient=True)
        for count in range(1, length):
            for at in range(len(data) - count + 1):
                found = heard(data[:at] + data[at + count :], with_sum=with_sum, lenient=True)
                assert set(found) <= set(said)


def test_a_lost_run_of_just_a_line_may_join_two_set_points() -> None:
    """The loss of 14 adjacent characters (one line) can join two set-points to a wrong one.

    A board loses characters for at most 13 ms, so set-points are sent at least 18 ms apart.
    """
    data = encode_command(SetRpm(17, 17)) + encode_command(SetRpm(0, 0))
    joined = data[:7] + data[21:]
    assert heard(joined, with_sum=True, lenient=False) == [(2, 17 << 16)]


def test_a_lost_run_of_just_a_line_may_join_a_stop_to_a_setting_after_it() -> None:
    """If a Stop and a later setting lose 14 adjacent characters, the rest can command full duty.

    So a setting after a set-point, such as Stop, must wait (15 ms). The reverse order is safe.
    """
    stop = encode_command(STOP)
    low_pass = encode_command(WriteSetting(Setting.RPM_LOW_PASS, 1.0))
    assert heard(stop[:3] + low_pass[3:], with_sum=True, lenient=False) == [(1, 0x3F80_0000)]
    for at in range(1, 14):
        found = heard(low_pass[:at] + stop[at:], with_sum=True, lenient=False)
        assert all(line == (1, 0) or line[0] == 0x23 for line in found)


@pytest.mark.parametrize("with_sum", [True, False], ids=["with sum", "without"])
def test_a_lost_run_of_just_a_line_may_join_an_led_line_only_to_a_motion_before_it(
    with_sum: bool,
) -> None:
    """If a motion line and a later LED line lose a whole line's length, a wrong motion can remain.

    The reverse order is safe, so only an LED line after a motion line must wait (15 ms).
    """
    length = 14 if with_sum else 12
    motion = encode_command(SetRpm(16, 20), with_sum=with_sum)
    led = encode_command(SetLed(True), with_sum=with_sum)

    def joined(data: bytes) -> set[tuple[int, int]]:
        rests = (data[:at] + data[at + length :] for at in range(1, length))
        found = [heard(rest, with_sum=with_sum, lenient=False) for rest in rests]
        return {line for lines in found for line in lines if line[0] in (1, 2)}

    assert (2, 0x0010_0001) in joined(motion + led)
    assert joined(led + motion) <= {(2, 0x0010_0014)}


def test_set_points_are_found_in_what_was_written() -> None:
    """The written bytes contain set-points and other commands. Only the set-points are found."""
    commands = [STOP, Reset(), CLEAR, SetRpm(20, -20), SetDuty(5, 6)]
    for with_sum in (True, False):
        data = b"".join(encode_command(command, with_sum=with_sum) for command in commands)
        found = set_points(data, with_sum=with_sum)
        assert found == [STOP, CLEAR, SetRpm(20, -20), SetDuty(5, 6)]
    assert set_points(b"", with_sum=True) == []
