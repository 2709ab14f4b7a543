# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The covariance of odometry is large enough for its error, even on the worst network."""

from statistics import mean

import pytest
from honesty import NETWORKS, RARE, drive

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("network", NETWORKS)
def test_odometry_is_no_farther_off_than_its_covariance_says(network: str) -> None:
    """The drives are forward, backward, curved and on the spot; the motors differ by up to 4 %."""
    drives = [list(drive(NETWORKS[network], seed)) for seed in range(5)]
    every = [value for each in drives for value in each]
    assert mean(each[-1] for each in drives) < 3.0
    assert mean(every) < 3.0
    assert sum(value > RARE for value in every) / len(every) < 0.02
