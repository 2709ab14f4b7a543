# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that the covariance of the odometry covers its error, even on the worst network."""

from statistics import mean

import pytest
from honesty import NETWORKS, RARE, drive

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("network", [name for name in NETWORKS if not name.startswith("late")])
def test_odometry_is_no_farther_off_than_its_covariance_says(network: str) -> None:
    """The error of the odometry fits its covariance, in drives of all kinds.

    The network that only delays datagrams is not tested, because the worst network has the same
    delays.
    """
    drives = [list(drive(NETWORKS[network], seed)) for seed in range(3)]
    every = [value for each in drives for value in each]
    assert mean(each[-1] for each in drives) < 3.0
    assert mean(every) < 3.0
    assert sum(value > RARE for value in every) / len(every) < 0.02
