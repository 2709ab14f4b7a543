# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated Fejemis's brush, lift, LEDs, distance sensors, IMU and stored settings."""

from math import degrees, pi

import pytest
from fejemis_rig import DRIVE, FRONT, Rig


def test_brush_and_lift() -> None:
    """``brush`` switches the brush. ``motv`` drives the lift with a voltage for a time.

    ``motv`` with 0 V stops the lift earlier. At 6 V, the lift takes 12 s from end to end.
    """
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
    """The host sets the whole LED band and single LEDs. Each colour is limited to 0..255."""
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


def test_distances_to_a_wall() -> None:
    """All sensors measure the distance to a wall at 0.5 m.

    Without a wall, the sonar reports 0. The other sensors report the end of their range.
    """
    rig = Rig(front_m=0.5).booted()
    assert rig.ask(DRIVE, "tofdi") == ["tofd 0.500"]
    assert rig.ask(FRONT, "iri")[0].split()[:3] == ["irc", "0.500", "0.500"]
    assert rig.ask(DRIVE, "sr04i") == ["sr04 0.500"]
    free = Rig().booted()
    assert free.ask(DRIVE, "tofdi") == ["tofd 8.190"]
    assert free.ask(FRONT, "iri")[0].split()[1] == "0.990"
    assert free.ask(DRIVE, "sr04i") == ["sr04 0.000"]


def test_the_sonar_measures_when_it_is_triggered() -> None:
    """The sonar measures only when ``hcsr`` triggers it.

    Before that, it reports the old distance.
    """
    rig = Rig(front_m=2.0).booted()
    rig.drive("rc 2 0.5 0", 2.0)
    assert rig.ask(DRIVE, "sr04i") == ["sr04 2.000"]
    rig.say(DRIVE, "hcsr")
    assert 0.9 < float(rig.ask(DRIVE, "sr04i")[0].split()[1]) < 1.2


def test_the_gyro_is_calibrated_in_a_second_whether_it_stands_or_not() -> None:
    """``gyroc`` measures the gyro for a second, and stores the mean as the gyro's offset.

    It does this even if the robot turns.
    """
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
    """``acccal2`` calibrates the accelerometer as if the board were level.

    ``acccal`` sets the given offsets and scales.
    """
    rig = Rig(accel_noise_mps2=0.0).booted()
    rig.say(DRIVE, "acccal2")
    rig.run(1.2)
    numbers = [float(number) for number in rig.ask(DRIVE, "acci")[0].split()[1:]]
    assert numbers == pytest.approx([0.0, 0.0, 9.80665], abs=1e-3)
    rig.say(DRIVE, "acccal 0.08 -0.05 0.12 2 1 1")
    rig.run(0.01)
    assert rig.ask(DRIVE, "accoi") == ["acco 0.0800 -0.0500 0.1200"]


def test_the_yaw_of_the_imu_follows_the_robot() -> None:
    """The gyro has no bias, and the robot drives a curve. The IMU reports the robot's yaw."""
    rig = Rig(gyro_bias_dps=(0.0, 0.0, 0.0)).booted()
    rig.drive("rc 2 0.3 20", 4.0)
    yaw = float(rig.ask(DRIVE, "imuposei")[0].split()[3])
    assert (yaw - rig.board.truth.yaw_rad + pi) % (2 * pi) - pi == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("loads", ["eer", "setid 0"])
def test_the_yaw_of_the_imu_has_the_offset_of_a_configuration_that_was_just_loaded(
    loads: str,
) -> None:
    """``eer`` and ``setid 0`` replace the calibrated offset of the gyro, so the yaw drifts.

    First, the command ``gyroc`` calibrates the gyro. Then ``eer`` loads the saved configuration, or
    ``setid 0`` erases the configuration.
    """
    rig = Rig(gyro_bias_dps=(0.0, 0.0, 3.0), gyro_noise_dps=0.0).booted()
    rig.say(DRIVE, "gyroc")
    rig.run(1.2)
    rig.say(DRIVE, loads)
    rig.run(0.01)
    before = rig.board.drive.imu.orientation[2]
    rig.run(2.0)
    assert degrees(rig.board.drive.imu.orientation[2] - before) == pytest.approx(6.0, abs=0.1)


def test_the_answer_to_confs_has_the_steering_first() -> None:
    """Both Teensys receive ``confs TRACK STEERING``, but report ``confs STEERING TRACK``."""
    rig = Rig().booted()
    for port in (DRIVE, FRONT):
        rig.say(port, "confs 0.5 0.6")
        rig.run(0.01)
        assert rig.ask(port, "confsi") == ["confs 0.6000 0.5000"]


def test_configuration_is_lost_in_a_restart_unless_it_was_saved() -> None:
    """``eew`` saves the configuration. ``eer`` and a restart load the saved configuration."""
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
    """``setid 0`` erases the configuration.

    After that, ``eew`` saves nothing until the board receives another ``setid``.
    """
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
    """``cssteer`` sets the gains of the steering, in the order in which ``cpsteer`` reports them.

    With a lower gain, the steering is slower.
    """
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
