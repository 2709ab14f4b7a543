# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the angle of the front wheel: how it is relayed, when it is too old, a broken sensor."""

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, drive_until_refused, nominal

from omnibot_driver.core.errors import CommandRefused


def test_the_angle_is_relayed_in_the_pass_in_which_it_comes() -> None:
    """The front board sends the angle of its wheel 66 times a second.

    The driver relays each angle to the drive board without delay.
    """
    bench = nominal()
    mark = bench.now
    bench.drive_on(0.2, 0.4, 1.0)
    relayed = [at for at, to, data in bench.written if to == DRIVE and at > mark and b"fwl" in data]
    assert 60 <= len(relayed) <= 68
    assert bench.robot.drive.told_angle_deg == pytest.approx(
        bench.robot.vehicle.servo.angle_deg, abs=1.5
    )


def test_an_angle_older_than_60_ms_stops_the_robot() -> None:
    """If no angle of the front wheel arrives for 60 ms during a drive, the driver stops the robot.

    It does not wait for the next command.
    """
    bench = nominal()
    bench.drive_on()
    mark = bench.now
    bench.carry = lambda channel, data: b"" if channel == FRONT and b"fwl" in data else data
    bench.run(0.08)
    stops = [
        at for at, to, data in bench.written if at > mark and to == DRIVE and b"rc 2 0 0" in data
    ]
    assert stops[0] - mark <= 0.064
    assert any("60 ms" in text for text in bench.notices)


def refusal(bench: Bench) -> str:
    """Return the text with which a motion command is refused now."""
    with pytest.raises(CommandRefused) as refused:
        bench.drive()
    return str(refused.value)


def test_without_angles_a_command_is_refused_because_of_the_front_board() -> None:
    """If the front board sends no more angles, the refusal of a command names the front board.

    The drive board sends as before.
    """
    bench = nominal()
    bench.carry = lambda channel, data: b"" if channel == FRONT else data
    bench.run(0.08)
    assert "check the front board" in refusal(bench)


def test_a_late_read_is_not_blamed_on_the_front_board() -> None:
    """If the driver reads nothing for 0.1 s, a refusal of motion blames the late computer."""
    bench = nominal()
    bench.run(0.1)
    bench.read_s = 0.1
    bench.run(0.08)
    text = refusal(bench)
    assert "front board" not in text
    assert "computer" in text
    bench.read_s = 0.0
    bench.run(0.05)
    bench.drive()


@pytest.mark.parametrize("first", [DRIVE, FRONT])
def test_a_late_driver_is_not_blamed_on_the_front_board(first: int) -> None:
    """The driver reads nothing for 80 ms, and then reads the two boards in turn.

    Until the front board is read, a refusal of motion names the late computer as the cause.
    """
    bench = nominal()
    waiting = {DRIVE: b"", FRONT: b""}
    for _ in range(round(0.08 / bench.robot.tick_s)):
        bench.now += bench.robot.tick_s
        for channel, data in bench.robot.advance():
            waiting[channel] += data
    bench.session.inbound.receive(waiting[first], bench.now, first)
    bench.settle()
    if first == DRIVE:
        assert "computer" in refusal(bench)
    other = DRIVE + FRONT - first
    bench.session.inbound.receive(waiting[other], bench.now + 0.001, other)
    bench.settle()
    bench.drive()


def test_a_late_read_does_not_hide_a_silent_front_board() -> None:
    """The front board is silent, and the driver reads late.

    A refusal names the computer as the cause. As soon as a read is in time, a refusal names the
    front board.
    """
    bench = nominal()
    bench.run(0.1)
    bench.carry = lambda channel, data: b"" if channel == FRONT else data
    bench.read_s = 0.1
    bench.run(0.08)
    assert "computer" in refusal(bench)
    bench.read_s = 0.0
    bench.run(0.1)
    assert "check the front board" in refusal(bench)


def test_a_late_read_is_not_blamed_on_the_drive_board() -> None:
    """The driver reads nothing for 0.3 s.

    The refusal of a command names the computer as the cause. It does not name the drive board.
    """
    bench = nominal()
    bench.run(0.3)
    bench.read_s = 0.4
    bench.run(0.35)
    text = refusal(bench)
    assert "board and its cable" not in text
    assert "computer" in text


SENSOR = [
    "sensor-absent", "sensor-error", "hall-broken", "agc-unsettled", "offset-unfinished",
    "sine-unfinished", "cosine-unfinished", "magnet-weak", "agc-high", "agc-low",
    "cordic-overflow", "loops-unfinished", "supply-5v",
]  # fmt: skip


@pytest.mark.slow
def test_a_broken_angle_sensor_stops_the_robot() -> None:
    """The angle sensor of the front wheel reports a fault while the robot drives.

    The robot stops, and motion is refused until the fault ends.
    """
    bench = nominal()
    for fault in SENSOR:
        bench.drive_on(seconds=0.3)
        assert not bench.robot.standing
        told = len(bench.notices)
        bench.robot.befall("front", fault)
        drive_until_refused(bench)
        assert "angle sensor" in bench.notices[told], fault
        with pytest.raises(CommandRefused, match="angle sensor"):
            bench.drive()
        bench.robot.befall("front", "sensor-well")
        bench.run(0.6)
        assert bench.robot.standing, fault


def test_a_broken_angle_sensor_is_reported_while_the_robot_stands() -> None:
    """The angle sensor breaks while the robot is not driven. One notice reports it."""
    bench = nominal()
    bench.robot.befall("front", "hall-broken")
    bench.run(1.0)
    assert sum("angle sensor" in notice for notice in bench.notices) == 1


def test_a_sensor_that_repeats_its_last_angle_is_noticed_when_the_wheel_should_turn() -> None:
    """The angle sensor repeats its last angle, without an error bit, during a commanded turn.

    The driver stops the robot and reports that the wheel does not follow.
    """
    bench = nominal()
    bench.robot.befall("front", "sensor-frozen")
    with pytest.raises(CommandRefused, match="front wheel did not go where"):
        bench.drive_on(0.0, 0.5, 2.0)
    assert any("does not go where it is commanded" in text for text in bench.notices)
    assert bench.robot.standing


def test_a_robot_that_stands_is_not_set_in_motion_by_an_old_angle() -> None:
    """Both boards have been silent for 0.1 s, so the last angle is too old when a command comes.

    The driver refuses the command.
    """
    bench = nominal()
    bench.speaks = set()
    bench.run(0.1)
    mark = bench.now
    with pytest.raises(CommandRefused, match="nothing from either board"):
        bench.drive()
    assert not [text for text in bench.lines(DRIVE, mark) if text.startswith("rc 2 .")]
