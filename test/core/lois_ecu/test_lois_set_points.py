# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motions encoded as set-points of a LOIS ECU are compared with lines typed by hand."""

import math

import pytest

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu import RecordKind, SetDuty, SetRpm, Stream, encode_command
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.set_points import SetPoints
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

STOP = b":01000000003b\n"
CLEAR = b":020000000038\n"
RPM = math.tau / 60


def started(settings: LoisEcuSettings | None = None) -> LoisConversation:
    """Return a conversation that has already sent RPM 0/0 three times, as is due after a Stop."""
    ecu = LoisConversation(LoisEcuSettings() if settings is None else settings)
    ecu.wrote(CLEAR * 3, 0.0)
    return ecu


def test_stop_is_duty_zero_and_the_emergency_stop_is_rpm_zero() -> None:
    """Stop is encoded as the line for duty zero, and the e-stop as the line for RPM zero."""
    ecu = LoisConversation(LoisEcuSettings())
    assert ecu.stop() == STOP
    assert ecu.emergency_stop() == CLEAR


@pytest.mark.parametrize(
    ("rates", "line"),
    [
        ((20, 20), b":020014001438\n"),
        ((20, -20), b":020014ffec3b\n"),
        ((0.4, -0.4), STOP),
        ((0.6, 0.0), b":020001000039\n"),
        ((100, 50), b":020032001938\n"),
        ((-500, 0), b":02ffce00006f\n"),
    ],
)
def test_wheel_rates_are_whole_rpm_at_most_50(rates: tuple[float, float], line: bytes) -> None:
    """Above 50 RPM both wheels are slowed by the same factor. Rates that round to 0 are a Stop."""
    ecu = started()
    total = 0
    for character in line[:11]:
        total ^= character
    data = ecu.wheels([rate * RPM for rate in rates])
    assert data == line[:11] + b"%02x\n" % total
    assert ecu.figures.saturated == (max(map(abs, rates)) > 50)


def test_a_twist_is_said_and_understood() -> None:
    """``velocity`` encodes a twist as a line with two RPM values, and ``meaning`` decodes the line.

    The decoded twist differs from the encoded twist only by the rounding.
    """
    ecu = started()
    assert ecu.velocity(BodyTwist(0.2723, 0.0, 0.0)) == b":020014001438\n"
    meaning = ecu.meaning(ecu.velocity(BodyTwist(0.3, 0.1, 0.5)))
    assert meaning.vx_mps == pytest.approx(0.3, abs=0.007)
    assert meaning.vy_mps == 0.0
    assert meaning.yaw_rate_radps == pytest.approx(0.5, abs=0.03)
    assert ecu.meaning(ecu.stop()) == BodyTwist(0.0, 0.0, 0.0)


def test_an_inverted_board_has_its_wheels_exchanged() -> None:
    """On an inverted board, left and right wheel are exchanged in encoded and in decoded lines."""
    ecu = started(LoisEcuSettings(inverted=True))
    left = ecu.velocity(BodyTwist(0.0, 0.0, 0.5))
    assert left == started().velocity(BodyTwist(0.0, 0.0, -0.5))
    assert ecu.meaning(left).yaw_rate_radps > 0


def test_duty_is_limited() -> None:
    """If a duty is above the limit (in percent), both duties are reduced by the same factor."""
    ecu = started(LoisEcuSettings(drive_mode="duty", max_duty=60))
    percent_radps = 1 / (130.0 * 0.13)
    assert ecu.wheels([50 * percent_radps] * 2) == b":01003200323b\n"
    assert ecu.wheels([120 * percent_radps, 60 * percent_radps]) == encode_command_duty(60, 30)
    assert ecu.velocity(BodyTwist(0.2, 0.0, 0.0)) == encode_command_duty(26, 26)
    assert ecu.meaning(encode_command_duty(26, 26)).vx_mps == pytest.approx(0.2)


def encode_command_duty(left: int, right: int) -> bytes:
    return encode_command(SetDuty(left, right))


def test_the_first_set_points_after_a_stop_clear_the_measured_speed() -> None:
    """The driver sends RPM 0/0 before each of the first three set-points after a Stop.

    RPM 0/0 clears the board's old measured speed, with which a wheel might never start again.
    """
    ecu = started()
    drive = b":020014001438\n"
    for now in (1.0, 1.1):
        ecu.wrote(ecu.wheels((20 * RPM, 20 * RPM)), now)
    ecu.wrote(ecu.stop(), 2.0)
    for now in (2.1, 2.2, 2.3):
        data = ecu.wheels((20 * RPM, 20 * RPM))
        assert data == CLEAR + drive
        ecu.wrote(data, now)
    assert ecu.wheels((20 * RPM, 20 * RPM)) == drive


def test_a_record_that_cannot_complete_is_refused() -> None:
    """The driver rejects records of 0 or over 1024 samples: the board cannot complete them."""
    ecu = started()
    for samples in (0, 1025):
        with pytest.raises(RequestRefused, match="1 to 1024"):
            ecu.record(RecordKind.TORQUE, samples)


@pytest.mark.parametrize(
    ("kind", "samples", "line"),
    [
        (RecordKind.RPM, 100, b":04006400643e\n"),
        (RecordKind.TORQUE, 1, b":17000100013c\n"),
        (RecordKind.HEADING, 3, b":0c000000036a\n"),
    ],
)
def test_a_record_is_asked_for_three_times(kind: RecordKind, samples: int, line: bytes) -> None:
    """The driver sends the request for a record three times, because lines may be lost.

    It sends the three requests quickly, because each of them restarts the record.
    """
    ecu = started()
    ecu.record(kind, samples)
    sent = b"".join(ecu.due(0.01 * step) for step in range(100))
    assert sent.count(line) == 3
    ecu.record(kind, samples)
    assert line in b"".join(ecu.due(1.0 + 0.01 * step) for step in range(30))


@pytest.mark.parametrize(("periods_ms", "after_s"), [({Stream.TICKS: 200}, 2.0), ({}, 2.4)])
def test_slow_ticks_get_time_to_prove_the_standstill(
    periods_ms: dict[Stream, int], after_s: float
) -> None:
    """After a Stop, the driver waits for several tick reports before it sends RPM 0/0.

    The tick reports can prove the standstill, and RPM 0/0 ends the counting of ticks.
    """
    points = SetPoints(LoisEcuSettings(periods_ms=periods_ms))
    points.wrote(encode_command(SetRpm(20, 20)), 1.0)
    points.wrote(STOP, 5.0)
    assert points.clears_at == pytest.approx(5.0 + after_s)
