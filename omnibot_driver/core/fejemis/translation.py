# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Converts both boards' messages into readings in SI units, each with its timestamp.

The module knows units and readings; it does not know what the readings are used for.
"""

import math
from typing import Final

from omnibot_driver.core.fejemis.front_wheel import FrontWheel
from omnibot_driver.core.fejemis.imu import ImuSamples
from omnibot_driver.core.fejemis.imu_pairs import ImuPairs, Pair
from omnibot_driver.core.fejemis.messages import (
    Acceleration,
    Attitude,
    Battery,
    BoardPose,
    Distance,
    Gyro,
    Infrared,
    Magnetic,
    Message,
    WheelSpeeds,
)
from omnibot_driver.core.fejemis.odometry import PoseOdometry
from omnibot_driver.core.fejemis.readings import (
    BatteryReading,
    MagneticReading,
    RangeReading,
    SteeringReading,
)
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.teensy_clock import StampedReadings, TeensyClock
from omnibot_driver.core.readings import (
    ExtraReading,
    NoticeReading,
    OrientedImuReading,
    Quaternion,
    Reading,
)

TESLA_PER_MICROTESLA: Final = 1e-6
LOW_AGAIN_S: Final = 60.0
"""Shortest time in s between two notices of a low battery."""
SAMPLE_WITHIN_S: Final = 0.03
"""Limit, in s, for the age of the last IMU sample when an orientation arrives.

If the sample is younger, it is published together with the orientation. Otherwise, the orientation
is discarded.
"""


class Translation:
    """Converter of messages to readings.

    ``front``: state of the front wheel.

    ``stamped``: the readings with their timestamps.
    """

    def __init__(self, settings: FejemisSettings) -> None:
        self._settings = settings
        self.front = FrontWheel()
        self.odometry = PoseOdometry(settings.track_m)
        self._imu = ImuSamples(settings.acceleration_unit)
        self._pairs = ImuPairs()
        self.stamped = StampedReadings()
        self._low_told_at = -math.inf
        self._low = False
        self.connect()

    def configure(self, settings: FejemisSettings) -> None:
        """Use new settings from the next message on."""
        self._settings = settings
        self._imu.unit = settings.acceleration_unit

    def connect(self) -> None:
        """Begin a new connection: forget the front wheel's state, wheel speeds and IMU lines.

        The last pose and the state of the battery are kept.
        """
        self.front.begin()
        self.odometry.begin()
        self._begin_imu()
        self._imu_at = self._imu_stamp_s = -math.inf

    def restarted(self) -> None:
        """Forget the last pose and the IMU's sampling times, because the drive board restarted."""
        self.odometry.forget()
        self._begin_imu()

    def stalled(self) -> None:
        """Record that the driver stalled. Lines from the time of the stall may be missing."""
        self._pairs.stalled()

    def _begin_imu(self) -> None:
        self._imu.begin()
        self._pairs.begin()

    def add(self, reading: Reading, now: float) -> None:
        """Add a reading whose timestamp is its time of arrival, ``now``."""
        self.stamped.add(reading, now, now)

    def extra(self, content: object, now: float) -> None:
        """Add a reading that only a Fejemis has, with ``now`` as its timestamp."""
        self.add(ExtraReading(content), now)

    def steering(self, angle_rad: float, now: float) -> None:
        """Add the angle of the front wheel, in rad."""
        self.extra(SteeringReading(angle_rad), now)

    def hear_front(self, message: Message, now: float) -> None:
        """Convert a message of the front board, except the angle of the front wheel."""
        if isinstance(message, Infrared):
            first, second = message.distances_m
            self.extra(RangeReading("ir1", _seen(first)), now)
            self.extra(RangeReading("ir2", _seen(second)), now)

    def hear_drive(self, message: Message, clock: TeensyClock, now: float) -> None:
        """Convert a message of the drive board."""
        self.stamped.skew_ppm = clock.skew_ppm
        match message:
            case BoardPose():
                self._pairs.pose(message.time_s)
                stamp_s = clock.host_s(message.time_s)
                for reading in self.odometry.readings(message):
                    self.stamped.add(reading, stamp_s, now)
                self.settle(clock, now)
            case WheelSpeeds():
                self._pairs.other("vel")
                self.odometry.speeds(message)
            case Gyro():
                self._pairs.gyro(message, now)
            case Acceleration():
                self._pairs.acceleration(message, now)
            case Attitude():
                self._pairs.attitude(message, now)
            case Magnetic():
                x, y, z = (
                    TESLA_PER_MICROTESLA * axis for axis in (message.x, message.y, message.z)
                )
                self.extra(MagneticReading((x, y, z)), now)
            case Battery():
                self._battery(message, now)
            case Distance(keyword="tofd"):
                self.extra(RangeReading("tof", _seen(message.distance_m)), now)
            case Distance(keyword="sr04"):
                self.extra(RangeReading("sonar", _seen(message.distance_m)), now)

    def settle(self, clock: TeensyClock, now: float) -> None:
        """Add waiting IMU samples and orientations to the readings, in order of arrival.

        Stop at a sample that must wait for the next pose. Call this method after a pose and at the
        end of a read.
        """
        for item in self._pairs.take():
            if isinstance(item, Pair):
                self._sample(item, clock)
            else:
                self._orient(*item, now)

    def _sample(self, pair: Pair, clock: TeensyClock) -> None:
        stamp_s = pair.at
        if clock.known:
            board_s = clock.board_s(pair.at)
            poses_s = pair.pose_s, pair.next_pose_s
            stamp_s = clock.host_s(self._imu.sampled_s(board_s, *poses_s, pair.skipped))
        self._imu_at, self._imu_stamp_s = pair.at, min(stamp_s, pair.at)
        self.stamped.add(self._imu.reading(pair), stamp_s, pair.at)

    def _orient(self, message: Attitude, came_at: float, now: float) -> None:
        if math.isnan(self._imu.rates[0]) or came_at - self._imu_at >= SAMPLE_WITHIN_S:
            return
        oriented = OrientedImuReading(
            quaternion(message.roll_rad, message.pitch_rad, message.yaw_rad),
            self._imu.rates,
            self._imu.forces,
        )
        self.stamped.add(ExtraReading(oriented), self._imu_stamp_s, now)

    def _battery(self, message: Battery, now: float) -> None:
        low = message.cells > 0 and message.volts < message.cells * self._settings.low_cell_v
        self.extra(BatteryReading(message.volts, -message.amps, message.cells, low), now)
        was_low, self._low = self._low, low
        if low and was_low and now - self._low_told_at >= LOW_AGAIN_S:
            self._low_told_at = now
            self.add(
                NoticeReading(
                    f"battery is low: {message.volts:.1f} V of {message.cells} cells; charge it",
                    halt=False,
                ),
                now,
            )


def quaternion(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Return the quaternion x, y, z, w of rotations about the fixed axes x, y, z in this order."""
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _seen(distance_m: float) -> float:
    """Return a measured distance in m, or infinity if the sensor has measured none.

    A sensor that has measured no distance reports 0 or a negative number.
    """
    return distance_m if distance_m > 0.0 else math.inf
