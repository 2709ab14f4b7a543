# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Covariance of the body's pose and twist, from the states of the motion filter."""

from omnibot_driver.core.lois_ecu.sparse_filter import SparseFilter
from omnibot_driver.core.lois_ecu.wheel_motion import PER_WHEEL, SPEED, WAY, X, Y
from omnibot_driver.core.odometry.covariance import Covariance


def pose_covariance(motion: SparseFilter, turn: float) -> Covariance:
    """Return the covariance of x, y and yaw.

    ``turn``: yaw in rad for each m that the right wheel rolls farther than the left.
    """
    matrix = motion.covariance
    left, right = WAY, PER_WHEEL + WAY
    return Covariance(
        matrix[X][X],
        matrix[X][Y],
        turn * (matrix[X][right] - matrix[X][left]),
        matrix[Y][Y],
        turn * (matrix[Y][right] - matrix[Y][left]),
        turn * turn * (matrix[left][left] + matrix[right][right] - 2 * matrix[left][right]),
    )


def twist_variances(
    motion: SparseFilter, track_m: float, coasting_mps: tuple[float, float]
) -> tuple[float, float]:
    """Return the variances of the speed in (m/s)² and of the yaw rate in (rad/s)².

    ``coasting_mps``: for each wheel, standard deviation of its speed while coasting, with the sign
    of its direction. The errors of both wheels are correlated, so their signs matter.
    """
    left, right = SPEED, PER_WHEEL + SPEED
    speed = motion.variance_of([(left, 0.5), (right, 0.5)])
    turning = motion.variance_of([(left, -1 / track_m), (right, 1 / track_m)])
    left_mps, right_mps = coasting_mps
    speed += ((left_mps + right_mps) / 2) ** 2
    turning += ((right_mps - left_mps) / track_m) ** 2
    return 1e-4 + speed, 1e-3 + turning
