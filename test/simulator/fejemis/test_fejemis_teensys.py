# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the two halves of the simulated Fejemis: all functions except driving, and faults.

A *half* is one of the two Teensys (drive or front).
"""

import json

import pytest
from fejemis_rig import DRIVE, FRONT, Rig

from omnibot_driver.simulator.common import options
from omnibot_driver.simulator.fejemis import Fault, Firmware
from omnibot_driver.simulator.fejemis.faults import FAULTS, SENSOR_FAULTS

MODULE = "omnibot_driver.simulator.fejemis"


def angle_line(rig: Rig) -> tuple[float, int, int]:
    """Return the front angle in degrees, the angle sensor's error flags, and its diagnosis bits.

    The bits of the frame counter are removed from the diagnosis.
    """
    _, degrees, errors, bits = rig.ask(FRONT, "fwli")[0].split()
    return float(degrees), int(errors, 16), int(bits, 16) & 0x7FF


# Stop and start


def test_stop_stands_until_start_and_the_heartbeat_shows_it() -> None:
    """After ``stop``, the board ignores ``rc`` until ``start`` comes.

    During this time, the heartbeats report -1 instead of the number of a command source.
    """
    rig = Rig().booted()
    rig.say(DRIVE, "rc 2 0.3 0")
    rig.run(0.5)
    assert rig.ask(DRIVE, "hbti")[0].split()[5] == "2"
    rig.say(DRIVE, "stop", "rc 2 0.3 0")
    rig.run(1.0)
    assert rig.board.standing
    assert rig.ask(DRIVE, "hbti")[0].split()[5] == "-1"
    rig.say(DRIVE, "start")
    rig.run(1.0)
    assert rig.board.standing
    assert rig.ask(DRIVE, "hbti")[0].split()[5] == "10"


def test_some_firmware_goes_on_after_start() -> None:
    """After ``start``, some firmware continues the last command. The manual does not say this."""
    rig = Rig(firmware=Firmware(sums=False, start_resumes=True)).booted()
    rig.say(DRIVE, "rc 2 0.3 0", "stop")
    rig.run(0.5)
    assert rig.board.standing
    rig.say(DRIVE, "start")
    rig.run(0.5)
    assert not rig.board.standing


# Restarts and lost halves


def test_drive_that_restarts_lets_its_motors_go_and_forgets() -> None:
    """The drive half restarts.

    The motors stop, and the half resets its pose and its subscriptions. The front half continues.
    """
    rig = Rig().booted()
    rig.say(DRIVE, "sub pose 20")
    rig.drive("rc 2 0.3 0", 1.0)
    rig.board.befall("drive", "restart")
    rig.relays = False
    rig.lines.clear()
    rig.run(1.0)
    assert rig.board.standing
    said = [text for _, port, text in rig.lines if port == DRIVE]
    assert said[0] == "# Starting main loop"
    assert all(text.startswith("hbt") for text in said[1:])
    pose = [float(number) for number in rig.ask(DRIVE, "posei")[0].split()[2:]]
    assert pose == pytest.approx([0.0, 0.0, 0.0], abs=0.002)
    assert rig.board.front.clock_s > 2.5


@pytest.mark.parametrize("boot_s", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("says_start", [True, False])
def test_a_boot_has_a_duration_and_its_last_line_can_be_left_out(
    boot_s: float, *, says_start: bool
) -> None:
    """A half ignores its input until its boot ends. Some firmware then sends a start line.

    The times in the half's lines are counted from the beginning of its boot.
    """
    rig = Rig(firmware=Firmware(sums=False, says_start=says_start), boot_s=boot_s).booted()
    began = rig.now
    rig.board.befall("drive", "restart")
    rig.run(boot_s - 0.004)
    rig.say(DRIVE, "ignored")
    rig.run(0.01)
    rig.say(DRIVE, "sub pose 20")
    rig.run(0.1)
    lines = [(at - began, text) for at, port, text in rig.lines if port == DRIVE]
    starts = [at for at, text in lines if text == "# Starting main loop"]
    assert starts == ([pytest.approx(boot_s, abs=0.003)] if says_start else [])
    poses = [(at, text) for at, text in lines if text.startswith("pose")]
    assert len(poses) == pytest.approx(5, abs=1)
    assert all(float(text.split()[1]) == pytest.approx(at, abs=0.003) for at, text in poses)


def test_front_that_restarts_switches_brush_and_lift_off() -> None:
    """The front half restarts. This switches brush and lift off, and the half sends no angle.

    The drive half keeps the last angle that it has received, and drives on.
    """
    rig = Rig().booted()
    rig.say(FRONT, "brush 1", "motv 6 4")
    rig.drive("rc 2 0.3 20", 1.0)
    told = rig.board.drive.told_angle_deg
    rig.board.befall("front", "restart")
    assert not rig.board.vehicle.brush
    assert rig.board.vehicle.lift.volts == 0.0
    assert not any("fwl" in text for _, text in rig.run(1.0))
    assert rig.board.drive.told_angle_deg == told
    assert not rig.board.standing


def test_what_is_sent_while_a_half_boots_is_lost() -> None:
    """The host sends ``stop`` to a half during its boot of 0.4 s. The line is lost."""
    rig = Rig()
    rig.say(DRIVE, "stop")
    rig.run(1.0)
    assert rig.board.drive.source == 10


@pytest.mark.slow
@pytest.mark.parametrize("half", ["drive", "front"])
@pytest.mark.parametrize("what", ["silent", "hung", "unplugged"])
def test_a_half_is_lost_alone_and_comes_back(half: str, what: str) -> None:
    """While one half is silent, hung or unplugged, the other half sends, and the robot drives on.

    A silent half still obeys commands; a hung or unplugged half does not. When the fault ends, the
    half sends again.
    """
    rig = Rig().booted()
    rig.drive("rc 2 0.3 0", 1.0)
    port = DRIVE if half == "drive" else FRONT
    rig.board.befall(half, what)
    assert {number for number, _ in rig.run(1.0)} == {1 - port}
    assert not rig.board.standing
    rig.say(port, "rc 2 0 0")
    rig.run(1.0)
    assert rig.board.standing == ((half, what) == ("drive", "silent"))
    rig.board.befall(half, "well")
    assert {number for number, _ in rig.run(1.0)} == {DRIVE, FRONT}


def test_sums_can_begin_and_end_in_each_half() -> None:
    """The front half begins to send checksums while it runs, and later ends this.

    Its checksums do not change the lines of the drive half, which have none.
    """
    rig = Rig().booted()
    rig.board.befall("front", "sums-begin")
    said = dict(rig.run(0.5))
    assert said[FRONT].startswith(";")
    assert said[DRIVE].startswith("hbt")
    rig.board.befall("front", "sums-end")
    assert dict(rig.run(0.5))[FRONT].startswith("hbt")


def test_faults_can_be_planned() -> None:
    """A user plans faults for certain times, in any order. The faults occur at these times."""
    late = Fault(at_s=2.0, half="front", what="well")
    rig = Rig(faults=(late, Fault(at_s=1.0, half="front", what="silent")))
    assert FRONT in {port for port, _ in rig.run(0.99)}
    assert not rig.board.front.silent
    rig.run(0.02)
    assert rig.board.front.silent
    assert FRONT not in {port for port, _ in rig.run(0.98)}
    assert rig.board.front.silent
    rig.run(0.02)
    assert not rig.board.front.silent


def test_ports_can_be_swapped_and_ids_be_others() -> None:
    """The heartbeats show the ids of the halves, also with swapped ports or an unusual id."""
    rig = Rig(swapped=True)
    rig.run(1.0)
    assert any(port == FRONT and " 90 " in text for _, port, text in rig.lines)
    assert any(port == DRIVE and " 91 " in text for _, port, text in rig.lines)
    other = Rig(ids=(42, 91))
    other.run(1.0)
    assert any(port == DRIVE and " 42 110 " in text for _, port, text in other.lines)


# The angle sensor


def test_a_healthy_sensor_says_so_with_a_frame_counter() -> None:
    """The diagnosis of a healthy angle sensor is ``0x3c2`` or ``0x13c2``, as in the manual's list.

    The two differ only in the frame counter.
    """
    rig = Rig().booted()
    bits = [rig.ask(FRONT, "fwli")[0].split()[3] for _ in range(8)]
    assert set(bits) == {"0x3c2", "0x13c2"}


@pytest.mark.parametrize(
    ("what", "diagnosis"),
    [
        ("hall-broken", 0x7C2),
        ("agc-unsettled", 0x1C2),
        ("offset-unfinished", 0x2C2),
        ("sine-unfinished", 0x342),
        ("cosine-unfinished", 0x382),
        ("magnet-weak", 0x3E2),
        ("agc-high", 0x3D2),
        ("agc-low", 0x3CA),
        ("cordic-overflow", 0x3C6),
        ("loops-unfinished", 0x3C0),
        ("supply-5v", 0x3C3),
    ],
)
def test_each_bit_of_the_diagnosis_can_be_wrong(what: str, diagnosis: int) -> None:
    """Each fault of the angle sensor changes its own bit of the diagnosis.

    The manual has a list of these bits.
    """
    rig = Rig().booted()
    rig.board.befall("front", what)
    assert angle_line(rig)[1:] == (0, diagnosis)
    rig.board.befall("front", "sensor-well")
    assert angle_line(rig)[1:] == (0, 0x3C2)


def test_a_sensor_that_is_frozen_absent_or_in_error() -> None:
    """The front board reports a frozen, an absent and a faulty angle sensor in different ways.

    * Frozen: the angle stays the same.
    * Absent: the angle is 0, and the diagnosis changes.
    * Faulty: an error flag is set.
    """
    rig = Rig().booted()
    rig.say(FRONT, "rc 2 0.5 30")
    rig.run(1.0)
    angle_deg = angle_line(rig)[0]
    rig.board.befall("front", "sensor-frozen")
    rig.say(FRONT, "rc 2 0.5 60")
    rig.run(3.0)
    assert angle_line(rig) == (pytest.approx(angle_deg, abs=0.2), 0, 0x3C2)
    assert rig.board.vehicle.servo.angle_deg == 100.0
    rig.board.befall("front", "sensor-absent")
    rig.run(0.01)
    assert angle_line(rig) == (0.0, 0, 0x3C0)
    rig.board.befall("front", "sensor-error")
    assert angle_line(rig)[1] == 1


def test_the_offset_of_the_sensor_is_configured() -> None:
    """``fwoffset`` sets the offset of the front angle and its sign.

    The first number is the offset. If the second number is 1, the sign is reversed.
    """
    rig = Rig(sensor_zero_deg=7.0, angle_noise_deg=0.0).booted()
    assert angle_line(rig)[0] == 0.0
    rig.say(FRONT, "fwoffset 0 1")
    rig.run(0.01)
    assert angle_line(rig)[0] == -7.0
    assert rig.ask(FRONT, "fwoi") == ["fwo 0.00 1"]


# Power


def test_power_goes_off_after_its_delay_and_both_are_gone() -> None:
    """After ``off``, both halves lose their power when a delay is over. ``on`` cancels ``off``."""
    rig = Rig().booted()
    rig.say(FRONT, "brush 1")
    rig.say(DRIVE, "off 2")
    rig.run(1.0)
    rig.say(DRIVE, "on")
    rig.run(2.0)
    assert rig.board.drive.powered
    rig.say(DRIVE, "off 2")
    rig.run(2.1)
    assert rig.run(2.0) == []
    assert not rig.board.vehicle.brush
    rig.board.reboot()
    assert {port for port, _ in rig.run(1.0)} == {DRIVE, FRONT}


def test_a_drive_half_that_restarts_has_forgotten_that_power_was_to_go_off() -> None:
    """The drive half restarts during the delay of ``off``.

    It then forgets ``off``, so the power stays on.
    """
    rig = Rig().booted()
    rig.say(DRIVE, "off 2")
    rig.run(0.5)
    rig.board.befall("drive", "restart")
    rig.run(3.0)
    assert rig.board.drive.powered


# What a user chooses


def test_options_reach_the_board_by_a_url() -> None:
    """A URL can set the same options and faults as the command line.

    All of them reach the simulated board.
    """
    url = (
        "sim://?sums=off&reverse=clamped&swapped&ids=90,7&fault=1:front:silent&fault=2:drive:hung"
        "&lose-inbound=0.1&timed-velocity&volts=21.5&front-m=3&uptime=100&boot=0.05&no-start-line"
    )
    board, _ = options.from_url(url, options.load(MODULE))
    settings = board.settings  # type: ignore[attr-defined]
    assert (settings.firmware.sums, settings.firmware.reverse) == (False, "clamped")
    assert settings.firmware.timed_velocity
    assert (settings.boot_s, settings.firmware.says_start) == (0.05, False)
    assert [fault.what for fault in settings.faults] == ["silent", "hung"]
    assert (settings.ids, settings.swapped, settings.front_m) == ((90, 7), True, 3.0)
    json.dumps(board.facts)


@pytest.mark.parametrize(
    "wrong",
    [
        "fault=5:rear:silent",
        "fault=nan:drive:silent",
        "fault=5:drive:hall-broken",
        "ids=a,b",
        "boot=-1",
    ],
)
def test_a_wrong_option_is_refused(wrong: str) -> None:
    """A URL with a wrong option is refused.

    An example of a wrong option is a fault of the angle sensor in the drive half.
    """
    with pytest.raises(options.OptionError):
        options.from_url(f"sim://?{wrong}", options.load(MODULE))


def test_the_names_of_faults_are_unique() -> None:
    """No fault of a half has the same name as a fault of the angle sensor."""
    assert not FAULTS.keys() & SENSOR_FAULTS.keys()
