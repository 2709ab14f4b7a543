# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A short version of the timing report, as tests."""

import pytest
from stamping import BUSY, LINES, spread, stamp

FRAME_S = 14 * 10 / 115200
PROMPT = [line for line in LINES if "block" not in line]
SCENARIOS = pytest.mark.parametrize(
    ("scenario", "skew"), [("driving", 1e-4), ("IMU only, noisy gyro", -1e-4)]
)


@pytest.mark.parametrize("line", PROMPT)
@SCENARIOS
def test_lost_bytes_shift_no_stamps(line: str, scenario: str, skew: float) -> None:
    """One byte in 1000 is lost, but the intervals between stamps are even within 0.2 ms (RMS).

    After the first 2 s, the errors of 99 % of the stamps differ from a constant offset by less than
    0.5 ms.
    """
    stamped = stamp(line, scenario, 1e-3, skew, 0, 10.0)
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
    """Stamps stay correct if one byte in 100 is lost.

    The streams are those in which an old version of the driver computed wrong stamps.
    """
    stamped = stamp(line, scenario, 1e-2, skew, seed, 30.0)
    assert stamped.unevenness() < 0.2e-3
    assert spread(stamped.errors()) < 0.5e-3


@pytest.mark.parametrize(
    ("event", "skew"),
    [("the board restarts", 1e-4), ("stall of 0.3 s", -1e-4), ("stall of 2 s", 1e-4)],
)
def test_a_free_timer_is_seen_through_within_two_seconds_of_a_start(
    event: str, skew: float
) -> None:
    """The board restarts, or the host stalls, on a line with an FTDI adapter.

    The errors of 99 % of the stamps lie within ±0.5 ms of one value. The first 2 s of the stream,
    and the first 2 s after a restart, are left out.
    """
    stamped = stamp("FTDI", "IMU only, noisy gyro", 0.0, skew, 0, 20.0, event)
    assert stamped.unevenness() < 0.2e-3
    assert spread(stamped.errors()) < 0.5e-3


def test_a_timer_that_may_never_cut_a_frame_hides_half_of_what_it_could_at_the_most() -> None:
    """If an FTDI timer cuts no frame in two, all stamps are late by one frame's duration ±0.5 ms.

    Without a cut frame, the driver knows the times of the timer only roughly.
    """
    # The adapter's timer keeps its phase relative to the ticks. A frame that the timer cuts in two
    # would show this phase. If no frame is cut, the driver can determine the phase only to within
    # 2 ms minus the duration of 13 bytes.
    for seed in range(5):
        stamped = stamp("FTDI", "IMU only, noisy gyro", 0.0, 0.0, seed, 4.0)
        assert max(abs(error - FRAME_S) for error in stamped.errors()) < 0.5e-3


@pytest.mark.parametrize("reader", [name for name in BUSY if "parts" not in name])
@SCENARIOS
def test_a_reader_that_is_late_shifts_no_stamps(reader: str, scenario: str, skew: float) -> None:
    """A busy computer reads late, but the stamps are as accurate as usual.

    The test omits the reader that takes only 1 to 8 of the waiting bytes in each read: it shifts
    some stamps by a tick.
    """
    stamped = stamp(reader, scenario, 0.0, skew, 0, 10.0)
    assert spread(stamped.errors()) < 0.5e-3
    if reader in ("single bytes, late", "1-8 bytes, late"):
        assert stamped.unevenness() < 0.2e-3
