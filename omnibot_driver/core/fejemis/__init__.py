# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Fejemis sweeping robot: two Teensy boards that send and obey lines of text.

The package works on bytes and times only, without ports, clocks or ROS.
"""

from omnibot_driver.core.fejemis.decoder import FejemisDecoder
from omnibot_driver.core.fejemis.readings import (
    BatteryReading,
    Job,
    JobDone,
    MagneticReading,
    OrientedImuReading,
    RangeReading,
    SteeringReading,
)
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written

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
