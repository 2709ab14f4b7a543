# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The two distance sensors of the drive Teensy, which look forward at a wall across the x axis.

The sonar measures only when it is triggered. The module knows only the pose and the wall.
"""

from math import cos

from omnibot_driver.simulator.fejemis.settings import FejemisSettings
from omnibot_driver.simulator.fejemis.vehicle import Vehicle

TOF_FAR_M = 8.19
SONAR_FAR_M = 4.0


class Distances:
    """The two distance sensors.

    ``sonar_m``: last measurement of the sonar in m; 0 if the wall was out of range.
    """

    def __init__(self, settings: FejemisSettings, vehicle: Vehicle) -> None:
        self._settings, self._vehicle = settings, vehicle
        self.trigger()

    def trigger(self) -> None:
        """Measure once with the sonar."""
        distance_m = max(0.0, self._wall_m())
        self.sonar_m = distance_m if distance_m < SONAR_FAR_M else 0.0

    @property
    def tof_m(self) -> float:
        """Distance in m by time of flight; the sensor's range if the wall is further away."""
        return min(TOF_FAR_M, max(0.0, self._wall_m()))

    def _wall_m(self) -> float:
        truth = self._vehicle.truth
        facing = cos(truth.yaw_rad)
        return (self._settings.front_m - truth.x_m) / facing if facing > 0.1 else float("inf")
