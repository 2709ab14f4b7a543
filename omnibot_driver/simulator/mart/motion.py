# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The state that the server keeps for each kind of motion; reply texts, speeds and times.

This module only holds the values; it does not know what changes them.
"""

from enum import IntEnum

SAMPLE_S = 0.01
START_SAMPLES, STOP_SAMPLES, STILL_SAMPLES = 60, 75, 15
SLOW_STOP_SAMPLES = 188
FAST_REGISTER = 45
"""Motor register below which a forward drive (RM) is regarded as fast; 0 is full speed.

A fast drive stops gently.
"""
SETUP_S = 0.05
BIAS_SAMPLE_S = 0.0107
LOST_AT_START_S, LOST_S = 0.5, 1.5
REAR_CLEARANCE_IN, FRONT_CLEARANCE_IN = 15, 19
INCHES_PER_M = 1 / 0.0254

MPU_LOST = "MPU6050 connection lost"
CONFLICT = "fail conflicting action in progress"
NOT_SUPPORTED = "fail command not supported"


class Kind(IntEnum):
    """The kinds of motion. The server keeps a separate state for each kind."""

    LINEAR = 0
    """Uncontrolled move (F, B)."""
    REFERENCE = 1
    """Reference move: forward, with changes of speed (RM)."""
    SPIN = 2
    """Uncontrolled spin (R, L)."""
    CONTROLLED_SPIN = 3
    """Spin by an angle (MCR, MCL)."""
    CONTROLLED_LINEAR = 4
    """Move over a distance that the server measures by time (TF, TB, PTF)."""
    MEASURED_LINEAR = 5
    """Move over a distance that the server measures by the accelerometer (MCF, MCB)."""


SPEEDS = {"NORMAL": 30, "FAST": 60, "SLOW": 20}
STOP_OFFSET_DEG = {"NORMAL": 3.16, "SLOW": 0.7}
SMALL_SPIN_DEG = 10
TOP_SPEED_INPS = {"NORMAL": 0.64 * 12, "SLOW": 0.34 * 12}
RAMPS_S = {"NORMAL": (0.3, 0.12), "SLOW": (0.2, 0.08)}
"""Calibrated durations of acceleration and deceleration in s. The key is the speed word."""


class Motion:
    """The state of the last motion of a kind, kept after its end.

    * ``running``: whether the motion is in progress; the server then refuses other motions.
    * ``watching``: whether the module ``alarms`` supervises the motion.
    * ``posts``: number of starts and ends that no command has noticed yet.
    * ``right``, ``left``: motor registers, as the server knows them.
    * ``sampled_s``: time of the last sample of the IMU, or -1.
    * ``moved_s``, ``turned_s``: first and last time at which the right wheel turned.
    * ``released``: whether a command at the stop port ended the motion.
    """

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.running = self.starting = self.stopping = self.watching = self.released = False
        self.posts = 0
        self.clearance_in = FRONT_CLEARANCE_IN
        self.reported_in = 0.0
        self.speed, self.word, self.backward = 0, "NORMAL", False
        self.docking = self.no_clearance = False
        self.target, self.limited, self.stop_after_s = 0, True, 0.0
        self.begin(0.0)
        self.starting = False

    def begin(self, now: float) -> None:
        """Reset the state for a motion that begins at ``now``."""
        self.error = ""
        self.starting, self.stopping, self.watching, self.released = True, False, True, False
        self.right = self.left = 128
        self.samples = self.same = self.encoder = self.last_encoder = self.sample_count = 0
        self.sampled_s = -1.0
        self.started_s = self.moved_s = self.turned_s = now
        self.angle_deg = self.last_rate = self.angle_sum = self.last_angle = 0.0
        self.correction = 0
        self.first_sample = True
        self.stop_samples = STOP_SAMPLES

    def limit(self, inches: int) -> None:
        """Set the time after which the motion stops.

        The time follows from the distance and the calibration.
        """
        up_s, down_s = RAMPS_S[self.word]
        top_inps = TOP_SPEED_INPS[self.word]
        self.stop_after_s = (inches - (up_s + down_s) / 2 * top_inps) / top_inps + up_s
        self.limited = True

    def copy(self) -> "Motion":
        """Return an independent copy."""
        new = Motion.__new__(Motion)
        new.__dict__.update(self.__dict__)
        return new
