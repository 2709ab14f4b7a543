# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The cost of an interpretation of the bytes: the evidence against it as one number.

A cost is about -ln(probability). Unusual content costs less than damage, so the frames of a real
shock are accepted.

This module knows what boards send, and how lines damage it; it does not know the search
(``trellis``) or the acceptance (``decoder``).
"""

from math import ceil, floor
from typing import Final, NamedTuple

from omnibot_driver.core.omnibot.frames import (
    LENT,
    DeltaFrame,
    Frame,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    Words,
)
from omnibot_driver.core.omnibot.schedule import USUAL, Schedule

# Damage by the line.
ONE_BYTE: Final = 5.5
"""Cost of a frame that lost or gained one byte. About one frame in 250 is damaged in this way."""
TWO_BYTES: Final = 8.5
"""Cost of a frame that lost or gained two bytes. Bytes are often lost together, so the cost is less
than twice ``ONE_BYTE``."""
BROKEN_OFF: Final = 9.0
"""Cost of a frame whose last three or more bytes were lost in a burst."""
HEADER_BYTE: Final = 7.5
"""Cost of a frame that lost one of its two header bytes."""
HEADER_IN_PLACE: Final = 4.0
"""Extra cost of assuming that a frame gained bytes, if the next header is at its usual place. The
frame has then probably gained no bytes."""
BAD_RUN: Final = 6.0
"""Cost of beginning a run of unexplained bytes (a bad run).

Noise, or the loss of many bytes at once, causes such a run.
"""
BAD_TAIL: Final = 2.5
"""Extra cost of a run of unexplained bytes that follows a frame but does not begin with a header.
Such a run is rare."""
UNKNOWN_START: Final = 1.0
"""Cost of the assumption that the bytes begin within a frame.

After a silence, the first bytes are more likely the beginning of a frame.
"""
BAD_BYTE: Final = 0.35
"""Cost of each byte of a run of unexplained bytes, in addition to ``BAD_RUN``. A run as long as an
IMU frame costs more than any true IMU frame."""
BAD_HEADER: Final = 0.5
"""Cost of a header within unexplained bytes. Such a header may arise by chance, or from the values
of a gyro at rest."""
GAP: Final = 5.0
"""Cost of a frame whose bytes arrived with a pause between them: the board does not interrupt a
frame."""
BAD_TEXT: Final = 4.0
"""Cost of leaving a complete «Paused» text unexplained. The cost is high, because the nine fixed
bytes of this text hardly arise by chance."""
KNOWN_GAP: Final = 11.0
"""Cost of a frame that contains a pause, if pauses on this line are known to be between frames.

If the pause lasts ``late_reads.IDLE_S`` or longer, the cost applies to any line.
"""
CUT_SHORT: Final = 6.0
"""Cost of a frame that is incomplete because the line was closed."""
ENDS_IN_NOISE: Final = 2.0
"""Cost if the line falls silent within unexplained bytes; normally it falls silent after a
frame."""

# Content that the board sends. A true IMU frame costs 6.5 at most, a delta or a
# pose 4.5.
LEAPS: Final[tuple[float, ...]] = (0.0, 3.0, 3.5, 4.0, 4.0, 4.0, 4.0)
"""Cost of an IMU frame, by the number of its words that differ much from the previous IMU frame.

A shock changes several words at once, so several such words cost only a little more than one.
"""
AFTERSHOCK: Final = 1.5
"""Cost of an IMU frame with unusual content that follows another such frame.

The cost is low, because a shock lasts several frames.
"""
WEIGHTLESS: Final = 2.5
"""Cost of an acceleration below 0.5 g or above 2.5 g: a fall, a shock, or misread words."""
LOOK_ALIKE: Final = 12.0
"""Cost of an IMU frame whose acceleration is below 0.5 g and contains the bytes of an IMU header.

Such a frame probably begins at a gyro value of -6, which has the same two bytes.
"""
JUMP: Final = 2.5
"""Cost of a frame whose counter did not advance by one. The decoder then assumes that a frame was
lost before this one."""
IMPOSSIBLE: Final = 2.0
"""Cost of a movement that a robot with this board cannot make."""
OFF_BEAT: Final = 1.0
"""Cost of a delta after an unexpected number of IMU frames, or of a pose after an unexpected number
of deltas. At 25 Hz, four IMU frames and five deltas are expected."""

CONTRADICTED: Final = 1.5
"""Cost of a pose that contradicts the deltas: the change of its heading is not the sum of the turns
in the deltas."""

IMU_HEADER_WORD: Final = -6
"""The IMU header FF FA, read as a signed word."""
ROUNDING: Final = 1.5
ROUNDING_PER_DELTA: Final = 0.5
"""``ROUNDING``, ``ROUNDING_PER_DELTA``: limits of rounding errors, in 0.1 mrad.

The rounding error of a sum of n deltas is at most ``ROUNDING`` + n * ``ROUNDING_PER_DELTA``: 4 for
five deltas.
"""
FASTEST: Final = 1e5
"""Largest possible speed: 10 m/s or 10 rad/s, in the unit 0.1 mm/s or 0.1 mrad/s."""
FARTHEST_POSE: Final = 1e7
"""Limit of the coordinates of a pose in mm or mrad: 10 km, or 1600 turns.

A greater value was misread from other bytes.
"""
LONGEST_STEP: Final = 2000.0
"""Largest possible step between two poses, in mm or mrad: 10 m/s or 10 rad/s for 200 ms."""
DELTAS_MISSED: Final = 2
"""Number of missing deltas after which the decoder no longer expects a delta, at the beginning of a
stream or after damage."""


class Context(NamedTuple):
    """What is known from earlier frames when a frame is judged. None means unknown."""

    imu: ImuFrame | None = None
    seq: int | None = None
    pose: PoseFrame | None = None
    imus: int = 0
    """Number of IMU frames since the last delta."""
    deltas: int = 0
    """Number of deltas since the last pose."""
    shaken: bool = False
    """Whether the last IMU frame had unusual acceleration, or differed much from the IMU frame
    before it."""
    turned: int | None = None
    """Sum of the deltas' turns since the last pose, in 0.1 mrad."""

    def damaged(self) -> "Context":
        """Return what is still known of earlier frames after an unknown number of frames was lost.

        The sequence number, the pose and the sum of the deltas' turns are unknown then.
        """
        return Context(self.imu, deltas=self.deltas, shaken=self.shaken)


NOTHING_KNOWN: Final = Context()


class Expectation:
    """Judges the content of a frame by the frames before it.

    From accepted frames, it learns how much the IMU's words usually scatter.
    """

    def __init__(self, counts_per_g: float, schedule: Schedule = USUAL) -> None:
        self.imus_per_delta = schedule.imus_per_delta
        self.deltas_per_pose = schedule.deltas_per_pose
        self.largest_delta = round(FASTEST * schedule.delta_period_s)
        """Largest possible delta in 0.1 mm or 0.1 mrad: 4000 for 40 ms."""
        self.rounding = ROUNDING + ROUNDING_PER_DELTA * schedule.deltas_per_pose
        """Largest rounding error of the sum of the deltas between two poses, in 0.1 mrad."""
        self._lightest = (0.5 * counts_per_g) ** 2
        self._heaviest = (2.5 * counts_per_g) ** 2
        self._accel_scatter = 300.0
        self._gyro_scatter = 100.0
        self._accel_limit = 2400.0
        self._gyro_limit = 800.0
        self.calm = (floor(self._lightest), ceil(self._heaviest), 2400, 800)
        """Limits in counts. An IMU frame's content within these limits has no cost.

        In order: least and largest squared acceleration, largest change of an acceleration word and
        of a gyro word. Integers make the check faster.
        """

    def weigh(self, frame: Frame, before: Context) -> tuple[float, Context]:
        """Return the cost of a complete frame's content, and the context for the next frame."""
        if type(frame) is ImuFrame:
            last, seq, pose, imus, deltas, shaken, turned = before
            ax, ay, az = frame.accel
            cost = 0.0
            norm = ax * ax + ay * ay + az * az
            if not self._lightest < norm < self._heaviest:
                if norm < self._lightest and IMU_HEADER_WORD in frame.accel:
                    return LOOK_ALIKE, Context(frame, seq, pose, imus + 1, deltas, True, turned)
                cost = AFTERSHOCK if shaken else WEIGHTLESS
            after = Context(frame, seq, pose, imus + 1, deltas, cost > 0.0, turned)
            if last is None:
                return cost, after
            (px, py, pz), (pu, pv, pw) = last.accel, last.gyro
            u, v, w = frame.gyro
            far, fast = self._accel_limit, self._gyro_limit
            if (
                -far < ax - px < far
                and -far < ay - py < far
                and -far < az - pz < far
                and -fast < u - pu < fast
                and -fast < v - pv < fast
                and -fast < w - pw < fast
            ):
                return cost, after
            leaps = _leaps(frame.accel, last.accel, far) + _leaps(frame.gyro, last.gyro, fast)
            after = Context(frame, seq, pose, imus + 1, deltas, True, turned)
            return (AFTERSHOCK if shaken else cost + LEAPS[leaps]), after
        if type(frame) is DeltaFrame:
            return self._weigh_delta(frame, before)
        if type(frame) is PoseFrame:
            return self._weigh_pose(frame, before)
        return 0.0, NOTHING_KNOWN

    def _weigh_delta(self, frame: DeltaFrame, before: Context) -> tuple[float, Context]:
        cost = 0.0
        if max(abs(frame.dx), abs(frame.dy), abs(frame.dtheta)) > self.largest_delta:
            cost = IMPOSSIBLE
        imu, seq, pose, imus, deltas, shaken, turned = before
        next_one = seq is not None and frame.seq == (seq + 1) & 255
        turned = turned + frame.dtheta if next_one and turned is not None else None
        after = Context(imu, frame.seq, pose, 0, deltas + 1, shaken, turned)
        if seq is None:
            return cost, after
        if not next_one:
            return cost + JUMP, after
        return (cost if imus == self.imus_per_delta else cost + OFF_BEAT), after

    def _weigh_pose(self, frame: PoseFrame, before: Context) -> tuple[float, Context]:
        after = Context(before.imu, before.seq, frame, before.imus, 0, before.shaken, 0)
        x, y, theta = frame.x, frame.y, frame.theta
        if not (abs(x) < FARTHEST_POSE and abs(y) < FARTHEST_POSE and abs(theta) < FARTHEST_POSE):
            return IMPOSSIBLE + JUMP, after
        last = before.pose
        if last is None:
            return 0.0, after
        if frame.seq != (last.seq + 1) & 255:
            return JUMP, after
        moved = max(abs(x - last.x), abs(y - last.y), abs(theta - last.theta))
        cost = IMPOSSIBLE if moved > LONGEST_STEP else 0.0
        turned = before.turned
        if turned is not None and abs(10.0 * (theta - last.theta) - turned) > self.rounding:
            cost += CONTRADICTED
        on_beat = before.deltas == self.deltas_per_pose and before.imus == 0
        return (cost if on_beat else cost + OFF_BEAT), after

    def learn(self, frame: ImuFrame, last: ImuFrame) -> None:
        """Learn how much the IMU's words scatter, from two consecutive accepted frames."""
        (x, y, z), (px, py, pz) = frame.accel, last.accel
        (u, v, w), (pu, pv, pw) = frame.gyro, last.gyro
        d_accel = max(abs(x - px), abs(y - py), abs(z - pz))
        d_gyro = max(abs(u - pu), abs(v - pv), abs(w - pw))
        self._accel_scatter += (d_accel - self._accel_scatter) / 8
        self._gyro_scatter += (d_gyro - self._gyro_scatter) / 8
        self._accel_limit = 6 * self._accel_scatter + 100
        self._gyro_limit = 6 * self._gyro_scatter + 30
        lightest, heaviest, _, _ = self.calm
        self.calm = lightest, heaviest, ceil(self._accel_limit), ceil(self._gyro_limit)

    def more_is_due(self, frame: Frame, before: Context) -> bool:
        """Return whether the board may send another frame after ``frame``, in the same tick."""
        if isinstance(frame, ImuFrame):
            if before.seq is not None:
                return before.imus >= self.imus_per_delta - 1
            return before.imus < DELTAS_MISSED * self.imus_per_delta
        last = before.deltas >= self.deltas_per_pose - 1
        return isinstance(frame, DeltaFrame) and (before.pose is None or last)


def may_be_lent(frame: Frame, before: Context) -> bool:
    """Return whether the frame's last byte may belong to the next header instead.

    The byte must occur in headers. If an IMU frame repeats the last word of the previous IMU frame,
    the byte must be FF.
    """
    if isinstance(frame, ImuFrame):
        lent = frame.gyro[2] & 0xFF in LENT
        said = before.imu is not None and frame.gyro[2] == before.imu.gyro[2]
        return lent and (frame.gyro[2] & 0xFF == 0xFF or not said)
    return not isinstance(frame, PausedFrame) and frame.seq in LENT


def _leaps(now: Words, before: Words, limit: float) -> int:
    return sum(abs(a - b) >= limit for a, b in zip(now, before, strict=True))
