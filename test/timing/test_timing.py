# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A short version of the timing report."""

import pytest
from stamping import BUSY, LINES, spread, stamp

FRAME_S = 14 * 10 / 115200
PROMPT = [line for line in LINES if "block" not in line]


@pytest.mark.parametrize("line", PROMPT)
@pytest.mark.parametrize("scenario", ["driving", "IMU only, noisy gyro"])
def test_lost_bytes_shift_no_stamps(line: str, scenario: str) -> None:
    """With one byte in 1000 lost, stamps are even within 0.2 ms (std) and 99 % are within 0.5 ms.

    The first 2 s of each stream do not count.
    """
    for seed, skew in enumerate([1e-4, -1e-4]):
        stamped = stamp(line, scenario, 1e-3, skew, seed, 15.0)
        assert stamped.unevenness() < 0.2e-3
        assert spread(stamped.errors()) < 0.5e-3


@pytest.mark.parametrize(
    ("line", "scenario", "skew", "seed"),
    [
        ("FTDI", "driving", -1e-4, 0),
        ("FTDI", "IMU only, noisy gyro", -5e-5, 6),
        ("FTDI, timer restarted by data", "driving", -5e-5, 6),
        ("single bytes", "driving", 5e-5, 3),
    ],
)
def test_a_sample_that_a_loss_cut_and_a_delta_that_was_made_up_shift_none_either(
    line: str, scenario: str, skew: float, seed: int
) -> None:
    """With one byte in 100 lost, stamps are right on streams on which an old version failed."""
    stamped = stamp(line, scenario, 1e-2, skew, seed, 30.0)
    assert stamped.unevenness() < 0.2e-3
    assert spread(stamped.errors()) < 0.5e-3


@pytest.mark.parametrize("event", ["the board restarts", "stall of 0.3 s", "stall of 2 s"])
def test_a_free_timer_is_seen_through_within_two_seconds_of_a_start(event: str) -> None:
    """After a restart or a stall, stamps have the same constant offset as before, within 0.5 ms."""
    for seed, skew in enumerate([1e-4, -1e-4]):
        stamped = stamp("FTDI", "IMU only, noisy gyro", 0.0, skew, seed, 20.0, event)
        assert stamped.unevenness() < 0.2e-3
        assert spread(stamped.errors()) < 0.5e-3


def test_a_timer_that_may_never_cut_a_frame_hides_half_of_what_it_could_at_the_most() -> None:
    """Without skew, all stamps are late by the duration of a frame, to within 0.5 ms.

    An FTDI's timer then keeps its phase relative to the ticks, and may never cut a frame in two.
    The driver then knows the phase only to within 2 ms minus the duration of 13 bytes. The check
    leaves out the first 2 s of each stream.
    """
    for seed in range(10):
        stamped = stamp("FTDI", "IMU only, noisy gyro", 0.0, 0.0, seed, 4.0)
        assert max(abs(error - FRAME_S) for error in stamped.errors()) < 0.5e-3


@pytest.mark.parametrize("reader", [name for name in BUSY if "parts" not in name])
@pytest.mark.parametrize("scenario", ["driving", "IMU only, noisy gyro"])
def test_a_reader_that_is_late_shifts_no_stamps(reader: str, scenario: str) -> None:
    """Stamps of a late reader are as accurate as on an undisturbed line.

    The test omits readers that read in parts, because a few of their stamps are wrong by a tick.
    """
    for seed, skew in enumerate([1e-4, -1e-4]):
        stamped = stamp(reader, scenario, 0.0, skew, seed, 15.0)
        assert spread(stamped.errors()) < 0.5e-3
        if reader in ("single bytes, late", "1-8 bytes, late"):
            assert stamped.unevenness() < 0.2e-3
