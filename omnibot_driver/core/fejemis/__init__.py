# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Fejemis sweeping robot: two Teensy boards that exchange lines of text with the driver.

The package only handles bytes and times. It does not use ports, clocks or ROS.
"""

from omnibot_driver.core.fejemis.decoder import FejemisDecoder
from omnibot_driver.core.fejemis.readings import (
    BatteryReading,
    Job,
    JobDone,
    MagneticReading,
    RangeReading,
    SteeringReading,
)
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written
from omnibot_driver.core.readings import OrientedImuReading

__all__ = [
    "BatteryReading",
    "FejemisDecoder",
    "FejemisSettings",
    "Job",
    "JobDone",
    "MagneticReading",
    "OrientedImuReading",
    "RangeReading",
    "SteeringReading",
    "Written",
]
