# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What each half of the simulated Fejemis does beside driving, and what befalls it alone."""

import json
from math import pi

import pytest
from fejemis_rig import DRIVE, FRONT, Rig

from omnibot_driver.simulator.common import options
from omnibot_driver.simulator.fejemis import Fault, Firmware
from omnibot_driver.simulator.fejemis.faults import FAULTS, SENSOR_FAULTS

MODULE = "omnibot_driver.simulator.fejemis"


def angle_line(rig: Rig) -> tuple[float, int, int]:
    """Degrees, error flags, diagnosis without the frame counter."""
    _, degrees, errors, bits = rig.ask(FRONT, "fwli")[0].split()
    return float(degrees), int(errors, 16), int(bits, 16) & 0x7FF


# Stop and start


def test_stop_stands_until_start_and_the_heartbeat_shows_it() -> None:
    """rcSource is -1 meanwhile, and what is commanded does not count."""
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
    """The manual does not say whether the last command holds again."""
    rig = Rig(firmware=Firmware(sums=False, start_resumes=True)).booted()
    rig.say(DRIVE, "rc 2 0.3 0", "stop")
    rig.run(0.5)
    assert rig.board.standing
    rig.say(DRIVE, "start")
    rig.run(0.5)
    assert not rig.board.standing


# Restarts and lost halves


def test_drive_that_restarts_lets_its_motors_go_and_forgets() -> None:
    """Pose, subscriptions, source, time; the other half goes on."""
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


def test_front_that_restarts_switches_brush_and_lift_off() -> None:
    """It no longer sends the angle; drive goes on with the last one that it has."""
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
    """For 0.4 s."""
    rig = Rig()
    rig.say(DRIVE, "stop")
    rig.run(1.0)
    assert rig.board.drive.source == 10


@pytest.mark.parametrize("half", ["drive", "front"])
@pytest.mark.parametrize("what", ["silent", "hung", "unplugged"])
def test_a_half_is_lost_alone_and_comes_back(half: str, what: str) -> None:
    """The other one is heard all the time; the robot drives on."""
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
    """While it runs."""
    rig = Rig().booted()
    rig.board.befall("front", "sums-begin")
    said = dict(rig.run(0.5))
    assert said[FRONT].startswith(";")
    assert said[DRIVE].startswith("hbt")
    rig.board.befall("front", "sums-end")
    assert dict(rig.run(0.5))[FRONT].startswith("hbt")


def test_faults_can_be_planned() -> None:
    """As the options have them, in any order."""
    late = Fault(at_s=2.0, half="front", what="well")
    rig = Rig(faults=(late, Fault(at_s=1.0, half="front", what="silent")))
    rig.run(0.99)
    assert FRONT in {port for port, _ in rig.run(0.5)} or rig.board.front.silent
    assert rig.board.front.silent
    rig.run(0.6)
    assert not rig.board.front.silent


def test_ports_can_be_swapped_and_ids_be_others() -> None:
    """Each is found out by its heartbeat only."""
    rig = Rig(swapped=True)
    rig.run(1.0)
    assert any(port == FRONT and " 90 " in text for _, port, text in rig.lines)
    assert any(port == DRIVE and " 91 " in text for _, port, text in rig.lines)
    other = Rig(ids=(42, 91))
    other.run(1.0)
    assert any(port == DRIVE and " 42 110 " in text for _, port, text in other.lines)


# The angle sensor


def test_a_healthy_sensor_says_so_with_a_frame_counter() -> None:
    """``0x3c2`` and ``0x13c2``, as in the manual's list."""
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
    """By the manual's list of bits."""
    rig = Rig().booted()
    rig.board.befall("front", what)
    assert angle_line(rig)[1:] == (0, diagnosis)
    rig.board.befall("front", "sensor-well")
    assert angle_line(rig)[1:] == (0, 0x3C2)


def test_a_sensor_that_is_frozen_absent_or_in_error() -> None:
    """A frozen one looks healthy, and the steering runs to its end."""
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
    """``fwoffset``; the second number turns it round."""
    rig = Rig(sensor_zero_deg=7.0, angle_noise_deg=0.0).booted()
    assert angle_line(rig)[0] == 0.0
    rig.say(FRONT, "fwoffset 0 1")
    rig.run(0.01)
    assert angle_line(rig)[0] == -7.0
    assert rig.ask(FRONT, "fwoi") == ["fwo 0.00 1"]


# Brush, lift, light


def test_brush_and_lift() -> None:
    """12 s from end to end at 6 V; the voltage ends with its time, or with 0."""
    rig = Rig().booted()
    rig.say(FRONT, "brush 1", "motv 6 6")
    rig.run(1.0)
    assert rig.board.vehicle.brush
    assert rig.ask(FRONT, "moti") == ["mot 6.00 0 0 0 0 15000"]
    rig.run(9.0)
    assert rig.board.vehicle.lift.height == pytest.approx(0.5, abs=0.01)
    assert rig.board.vehicle.lift.volts == 0.0
    rig.say(FRONT, "motv -30 9")
    rig.run(1.0)
    assert rig.board.vehicle.lift.volts == -12.0
    rig.say(FRONT, "motv 0 0", "brush 0")
    rig.run(0.1)
    assert rig.board.vehicle.lift.volts == 0.0
    assert not rig.board.vehicle.brush


def test_the_band_and_single_leds() -> None:
    """0 to 255 of each colour."""
    rig = Rig().booted()
    rig.say(FRONT, "ledb 10 20 300", "led 3 1 2 3")
    rig.run(0.01)
    leds = rig.board.front.leds
    assert leds[0] == (10, 20, 255)
    assert leds[3] == (1, 2, 3)
    rig.say(FRONT, "leds", "ledon 0")
    rig.run(0.01)
    assert rig.board.front.leds[3] == (0, 20, 0)
    assert not rig.board.front.leds_on


# Sensors


def test_distances_to_a_wall() -> None:
    """Far away: 8.19 m, no echo, and the end of the infrared range."""
    rig = Rig(front_m=0.5).booted()
    assert rig.ask(DRIVE, "tofdi") == ["tofd 0.500"]
    assert rig.ask(FRONT, "iri")[0].split()[:3] == ["irc", "0.500", "0.500"]
    assert rig.ask(DRIVE, "sr04i") == ["sr04 0.500"]
    free = Rig().booted()
    assert free.ask(DRIVE, "tofdi") == ["tofd 8.190"]
    assert free.ask(FRONT, "iri")[0].split()[1] == "0.990"
    assert free.ask(DRIVE, "sr04i") == ["sr04 0.000"]


def test_the_sonar_measures_when_it_is_triggered() -> None:
    """``hcsr``; until then it repeats itself."""
    rig = Rig(front_m=2.0).booted()
    rig.drive("rc 2 0.5 0", 2.0)
    assert rig.ask(DRIVE, "sr04i") == ["sr04 2.000"]
    rig.say(DRIVE, "hcsr")
    assert 0.9 < float(rig.ask(DRIVE, "sr04i")[0].split()[1]) < 1.2


def test_the_gyro_is_calibrated_in_a_second_whether_it_stands_or_not() -> None:
    """The mean of what it reads becomes its offset."""
    rig = Rig().booted()
    rig.say(DRIVE, "gyroc")
    rig.run(1.2)
    offsets = [float(number) for number in rig.ask(DRIVE, "gyrooi")[0].split()[1:]]
    assert offsets == pytest.approx([0.4, -0.3, 0.25], abs=0.02)
    rig.drive("rc 2 0 10", 3.0)
    rig.say(DRIVE, "gyroc")
    rig.run(1.2)
    assert float(rig.ask(DRIVE, "gyrooi")[0].split()[3]) > 5.0


def test_the_accelerometer_is_calibrated_as_level() -> None:
    """``acccal2``; ``acccal`` sets offsets and scales."""
    rig = Rig(accel_noise_mps2=0.0).booted()
    rig.say(DRIVE, "acccal2")
    rig.run(1.2)
    numbers = [float(number) for number in rig.ask(DRIVE, "acci")[0].split()[1:]]
    assert numbers == pytest.approx([0.0, 0.0, 9.80665], abs=1e-3)
    rig.say(DRIVE, "acccal 0.08 -0.05 0.12 2 1 1")
    rig.run(0.01)
    assert rig.ask(DRIVE, "accoi") == ["acco 0.0800 -0.0500 0.1200"]


def test_the_yaw_of_the_imu_follows_the_robot() -> None:
    """A gyro without bias; a bias that is not calibrated away would add to it."""
    rig = Rig(gyro_bias_dps=(0.0, 0.0, 0.0)).booted()
    rig.drive("rc 2 0.3 20", 4.0)
    yaw = float(rig.ask(DRIVE, "imuposei")[0].split()[3])
    assert (yaw - rig.board.truth.yaw_rad + pi) % (2 * pi) - pi == pytest.approx(0.0, abs=0.01)


# Configuration


def test_the_answer_to_confs_has_the_steering_first() -> None:
    """``confs B F`` sets it, ``confs F B`` is the answer, in both halves."""
    rig = Rig().booted()
    for port in (DRIVE, FRONT):
        rig.say(port, "confs 0.5 0.6")
        rig.run(0.01)
        assert rig.ask(port, "confsi") == ["confs 0.6000 0.5000"]


def test_configuration_is_lost_in_a_restart_unless_it_was_saved() -> None:
    """``eew`` saves, ``eer`` loads, and so does a restart."""
    rig = Rig().booted()
    rig.say(DRIVE, "confw 0.08 0.081 20 64 0.41")
    rig.run(0.01)
    assert rig.ask(DRIVE, "confi") == ["conf 0.0800 0.0810 20.000 64 0.4100 0.0010"]
    rig.say(DRIVE, "eer")
    rig.run(0.01)
    assert rig.ask(DRIVE, "confi") == ["conf 0.0775 0.0775 19.000 68 0.4000 0.0010"]
    rig.say(DRIVE, "confw 0.08 0.081 20 64 0.41", "eew")
    rig.run(0.01)
    rig.board.befall("drive", "restart")
    rig.run(1.0)
    assert rig.ask(DRIVE, "confi")[0].startswith("conf 0.0800 0.0810")


def test_id_zero_erases_the_configuration() -> None:
    """Nothing is saved until the board has an id again."""
    rig = Rig().booted()
    rig.say(DRIVE, "setname cart", "confw 0.08 0.08 20 64 0.41", "eew", "setid 0")
    rig.run(0.01)
    assert rig.ask(DRIVE, "idi") == ["id drive 0"]
    assert rig.ask(DRIVE, "confi")[0].startswith("conf 0.0775")
    rig.say(DRIVE, "confw 0.08 0.08 20 64 0.41", "eew", "eer")
    rig.run(0.01)
    assert rig.ask(DRIVE, "confi")[0].startswith("conf 0.0775")
    rig.say(DRIVE, "setid 90", "eew")
    rig.run(0.01)
    assert rig.board.drive.saved.number == 90


def test_gains_of_the_steering_count() -> None:
    """``cssteer``, in the order of ``cpsteer``; half the gain is slower."""
    times = []
    for gain in (43, 10):
        rig = Rig().booted()
        rig.say(FRONT, f"cssteer 1 {gain} 0 0 0 1 1 0.16 0.048 0 0 0 0 0 0 1 1000", "rc 2 1 20")
        rig.run(0.01)
        assert rig.ask(FRONT, "cpsteeri")[0].split()[2] == str(gain)
        while rig.board.vehicle.servo.angle_deg < 5.0:
            rig.run(0.002)
        times.append(rig.now)
    assert times[1] > times[0] + 0.1


# Power


def test_power_goes_off_after_its_delay_and_both_are_gone() -> None:
    """``on`` before takes it back."""
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


# What a user chooses


def test_options_reach_the_board_by_a_url() -> None:
    """The same words as on the command line."""
    url = (
        "sim://?sums=off&reverse=clamped&swapped&ids=90,7&fault=1:front:silent&fault=2:drive:hung"
        "&lose-inbound=0.1&timed-velocity&volts=21.5&front-m=3&uptime=100"
    )
    board, _ = options.from_url(url, options.load(MODULE))
    settings = board.settings  # type: ignore[attr-defined]
    assert (settings.firmware.sums, settings.firmware.reverse) == (False, "clamped")
    assert settings.firmware.timed_velocity
    assert [fault.what for fault in settings.faults] == ["silent", "hung"]
    assert (settings.ids, settings.swapped, settings.front_m) == ((90, 7), True, 3.0)
    json.dumps(board.facts)


@pytest.mark.parametrize("wrong", ["fault=5:rear:silent", "fault=5:drive:hall-broken", "ids=a,b"])
def test_a_wrong_option_is_refused(wrong: str) -> None:
    """By a sentence; a drive half has no angle sensor."""
    with pytest.raises(options.OptionError):
        options.from_url(f"sim://?{wrong}", options.load(MODULE))


def test_the_names_of_faults_are_unique() -> None:
    """So one table is enough for the front half."""
    assert not FAULTS.keys() & SENSOR_FAULTS.keys()
