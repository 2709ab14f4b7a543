# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pose of the robot from the reports of a LOIS ECU and from the commands sent to it.

While the board counts no ticks, the driver predicts the motion from the commands, and corrects it
by the board's own odometry (0x20). All times are arrival times in s.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.board_kind import BoardKind
from omnibot_driver.core.lois_ecu.board_odometry import OdometryReader
from omnibot_driver.core.lois_ecu.comparison import Comparison
from omnibot_driver.core.lois_ecu.estimates import Estimates
from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.messages import BoardOdometry, SetDuty, SetRpm, Stream, Ticks
from omnibot_driver.core.lois_ecu.misconfiguration import own_gains
from omnibot_driver.core.lois_ecu.motion_filter import MotionFilter
from omnibot_driver.core.lois_ecu.plausibility import wrapped
from omnibot_driver.core.lois_ecu.settings import BOOT_PERIOD_MS, LoisEcuSettings
from omnibot_driver.core.lois_ecu.wheel_model import CommandKind
from omnibot_driver.core.lois_ecu.wheel_motion import PER_WHEEL, WAY, X, Y

UNHEARD_S: Final = 0.6
UNHEARD_GROUPS: Final = 3
"""How long the driver predicts the pose after the last tick or odometry report:
``UNHEARD_GROUPS`` periods of the tick reports, but at least ``UNHEARD_S`` seconds."""
LOST_REPORTS_S: Final = 1.2
"""Limit in s for a silence of the board. If a silence was shorter, and no set-point changed in it,
the driver assumes that only reports were lost, and that the wheels followed their set-points."""
LEAST_UNFORESEEN_TURNS: Final = 1 / 30
"""Smallest difference between a reported and an expected count, in turns of the wheel, that can
show a restart of the board."""
NUDGED_TURNS: Final = 1 / 60
"""Largest tick count, in turns of the wheel, that can show a restart of the board while the robot
is at rest. A larger count may come from a push. The limit is at least one tick."""
FASTEST_MPS: Final = 5.0


class LoisOdometry:
    """Odometry of a robot with a LOIS ECU. Pairs of values are for the left and the right wheel.

    ``estimates``: computes the estimates that the methods return.
    """

    def __init__(self, settings: LoisEcuSettings) -> None:
        self._motion = MotionFilter()
        self.estimates = Estimates(self._motion)
        self._comparison = Comparison(self._motion)
        self._kind = BoardKind(self._motion)
        self._ticks: Ticks | None = None
        self._begun = False
        self._estimated = False
        """Whether an estimate has been made since the odometry's time last advanced.

        If so, the wheels' flags ``blind`` (motion without counted ticks) are reset when the time
        next advances. Until then, an odometry report in the same read may need the flags.
        """
        self._may_roll_mps = 0.0, 0.0
        """Largest speed, in m/s, that each wheel can have had since the last report."""
        self._heard_at_s = self._lost_s = self._advanced_s = -math.inf
        self._said: SetRpm | SetDuty | None = None
        self._said_at_s = -math.inf
        """``_said``: the last set-point that was sent. ``_said_at_s``: time in s at which the
        set-point last changed."""
        self.configure(settings)
        self.reset()
        self.connect()

    def configure(self, settings: LoisEcuSettings) -> None:
        """Use the new ``settings`` from the next report on."""
        motion, yaw_rad = self._motion, self._motion.yaw_rad
        self._settings = settings
        period_s = settings.periods_ms.get(Stream.TICKS, BOOT_PERIOD_MS) / 1e3
        self._unheard_s = max(UNHEARD_S, UNHEARD_GROUPS * period_s)
        other_wheels = motion.tick_m != settings.tick_m
        motion.tick_m, motion.rpm_mps = settings.tick_m, settings.rim_mps_per_rpm
        motion.track_m = settings.track_m
        tuned = not own_gains(settings)
        if tuned is not motion.tuned:
            motion.tuned = tuned
            motion.speed_errors.begin_excess()
        motion.turn_sign = -1.0 if settings.inverted else 1.0
        motion.yaw0_rad += yaw_rad - motion.yaw_rad
        self._board = OdometryReader(settings.track_m, settings.rim_mps_per_rpm)
        if other_wheels:
            self._comparison.begin_counts()
        self.estimates.configure(settings)

    @property
    def yaw_rad(self) -> float:
        """Yaw of the last estimate, in rad."""
        return self.estimates.pose.yaw_rad

    @property
    def appends(self) -> bool:
        """Whether the board sends each odometry report directly after a tick report.

        The public firmware does this.
        """
        return self._kind.appends

    @property
    def counting(self) -> bool:
        """Whether the board counts the encoder ticks of both wheels at present."""
        return self._motion.signed or all(wheel.course.counting for wheel in self._motion.wheels)

    @property
    def resting(self) -> tuple[bool, bool]:
        """For each wheel: whether it is assumed to be at rest, although commanded backward."""
        left, right = self._motion.wheels
        return left.rests, right.rests

    def reset(self) -> None:
        """Move the origin of the odometry frame to the robot's current pose."""
        for state in (X, Y, WAY, PER_WHEEL + WAY):
            self._motion.filter.forget(state, 0.0, 0.0)
        for wheel in self._motion.wheels:
            wheel.rolled_to_m = 0.0
        self._motion.yaw0_rad = 0.0
        self.estimates.reset()
        self._motion.history.forget()

    def connect(self) -> None:
        """Begin a new connection.

        Before it began, the board's counters may have restarted. The pose continues nevertheless.
        """
        self._lost_s = max(self._heard_at_s, self._lost_s)
        self._ticks = None
        self._board.begin()
        self._at_s = self._odometry_at_s = self._heard_at_s = -math.inf
        self.estimates.heading_compared = False

    def restarted(self, now: float, age_s: float | None) -> None:
        """Record that the board has restarted, and so has lost its set-point.

        ``age_s``: time since the restart in s, None if unknown.
        """
        self._motion.restart(self._heard_at_s if age_s is None else now - age_s)
        self.connect()
        self._lost_s = self._advanced_s = -math.inf
        self._ticks = Ticks(0, 0, 0)
        self._comparison.begin_counts()

    def only_a_restart_explains(self, ticks: Ticks, now: float, late_s: float) -> bool:
        """Return whether only a restart of the board explains that the new counts are near zero.

        If the robot is at rest, and a new count is above ``NUDGED_TURNS``, a push may also explain
        the new counts. ``late_s``: how much later than usual the ticks arrived.
        """
        found, per_turn = self._unforeseen(ticks, now, late_s), self._settings.ticks_per_revolution
        most = max(NUDGED_TURNS * per_turn, 1)
        if self._motion.resting and max(abs(ticks.left), abs(ticks.right)) > most:
            return False
        least = LEAST_UNFORESEEN_TURNS * per_turn
        return any(sure and abs(count) >= least for count, sure in found)

    def may_have_restarted(self, ticks: Ticks, now: float, late_s: float) -> None:
        """Make each wheel's distance less certain: the board may have restarted unnoticed.

        The added standard deviation is the difference between the reported and the expected tick
        count.

        ``late_s``: how much later than usual the ticks arrived.
        """
        for index, (count, _) in enumerate(self._unforeseen(ticks, now, late_s)):
            self._motion.doubt_way(index, count * self._settings.tick_m)

    def _unforeseen(self, ticks: Ticks, now: float, late_s: float) -> list[tuple[float, bool]]:
        before = self._ticks
        if before is None:
            return []
        self._advance(min(now, self._heard_at_s + self._unheard_s))
        counts = wrapped(ticks.left - before.left), wrapped(ticks.right - before.right)
        return [
            self._comparison.unforeseen(index, count, late_s) for index, count in enumerate(counts)
        ]

    # Outbound

    def wrote(self, command: SetRpm | SetDuty, now: float) -> None:
        """Record that a set-point was sent to the board."""
        if command != self._said:
            self._said, self._said_at_s = command, now
        if isinstance(command, SetRpm):
            kind: CommandKind = "rpm"
            unit = self._settings.rim_mps_per_rpm
            speeds_mps = command.left_rpm * unit, command.right_rpm * unit
        else:
            kind, scale = "duty", self._settings.duty_scale
            speeds_mps = command.left_percent / scale, command.right_percent / scale
        for index, speed_mps in enumerate(speeds_mps):
            rolls_mps = self._motion.speed_mps(index)
            self._motion.wheels[index].command(now, kind, speed_mps, rolls_mps)
        left_mps, right_mps = self._may_roll_mps
        self._may_roll_mps = max(left_mps, abs(speeds_mps[0])), max(right_mps, abs(speeds_mps[1]))

    def halted(self, now: float) -> None:
        """Record that the board has set both set-points to zero, because of its e-stop button."""
        self.wrote(SetRpm(0, 0), now)

    def stalled(self, wheels: tuple[bool, bool]) -> None:
        """Record which wheels have stalled.

        The driver assumes that a stalled wheel came to rest when its reported speed last changed.
        """
        for index, stalled in enumerate(wheels):
            if stalled and self._motion.wheels[index].blind and not self._motion.signed:
                self._comparison.came_to_rest(index)

    # Inbound

    def heard_ticks(self, ticks: Ticks, now: float, late_s: float = 0.0) -> list[FusedOdometry]:
        """Process ticks (0x12), and return a list with the new estimate.

        The list is empty for the first ticks of a connection.

        ``late_s``: how much later than usual the ticks arrived.
        """
        before, from_s = self._ticks, self._at_s
        silent = self._was_silent(now)
        if silent:
            self._after_silence(now)
        self._advance(now)
        motion = self._motion
        yaw_rad, way_m = motion.yaw_rad, motion.way_m(0) + motion.way_m(1)
        self._ticks = ticks
        if before is None:
            self._kind.took_ticks((0, 0))
            self._comparison.begin_counts()
            if not self._begun:
                self._begun = True
                self.reset()
            self._keep(now)
            return []
        counts = wrapped(ticks.left - before.left), wrapped(ticks.right - before.right)
        if max(map(abs, counts)) * self._settings.tick_m > FASTEST_MPS * (now - from_s + 1.0):
            self._comparison.begin_counts()  # the counters have restarted
            return [self._estimate()]
        self._kind.took_ticks(counts)
        for index, count in enumerate(counts):
            self._comparison.count(index, count, now - from_s, late_s)
        if silent:
            # The counts show the distance and the turn of the silence, but not the curve.
            rolled_m = (motion.way_m(0) + motion.way_m(1) - way_m) / 2
            motion.doubt_place(rolled_m * min(abs(motion.yaw_rad - yaw_rad) / 2, 1.0))
        self._keep(now)
        return [self._estimate()]

    def heard_odometry(self, group: BoardOdometry, now: float, late_s: float = 0.0) -> None:
        """Process an odometry report. It corrects the predictions and estimates that follow.

        The command byte is 0x20 (manual), or 0x12 as for ticks (public firmware). ``late_s``: how
        much later than usual the report arrived, in s.
        """
        told = self._board.take(group)
        duration_s, self._odometry_at_s = now - self._odometry_at_s, now
        if self._ticks is None:
            return
        if self._heard_at_s > -math.inf and self._was_silent(now):
            self._after_silence(now)
            return
        self._advance(now)
        self._kind.took_odometry(appended=group.appended)
        if told is None or not self._blind:
            self._comparison.begin_odometry()
            self._kind.watch(told)
            return
        self._comparison.odometry(told, duration_s, late_s)
        self._keep(now)
        self.estimates.heading_compared = True

    def predict(self, now: float) -> FusedOdometry | None:
        """Return the odometry predicted for ``now``; None before a connection's first ticks."""
        if self._ticks is None or self._at_s == -math.inf:
            return None
        self._advance(min(now, self._heard_at_s + self._unheard_s))
        stamp_s = max(now, self._at_s)
        return self.estimates.now(stamp_s, stamp_s - self._at_s, self._may_roll_mps)

    def _keep(self, now: float) -> None:
        """Store the state after a report.

        The driver needs this state if it notices later that the board has restarted.
        """
        self._heard_at_s, self._lost_s = now, -math.inf
        left, right = self._motion.wheels
        self._may_roll_mps = (
            max(abs(self._motion.speed_mps(0)), abs(left.course.target_mps)),
            max(abs(self._motion.speed_mps(1)), abs(right.course.target_mps)),
        )
        self._motion.history.keep(now)

    def _was_silent(self, now: float) -> bool:
        """Return whether a report at ``now`` ends a silence in which the motion is unknown.

        The motion is known if the silence was shorter than ``LOST_REPORTS_S``, and no set-point
        changed in it.
        """
        heard_s = max(self._heard_at_s, self._lost_s)
        if not now > heard_s + self._unheard_s > -math.inf:
            return False
        connected = self._at_s > -math.inf
        lost = connected and self._said_at_s < heard_s and now < heard_s + LOST_REPORTS_S
        return not lost

    def _after_silence(self, now: float) -> None:
        """Add errors to the wheels' distances after a silence in which the motion is unknown.

        The wheels may have rolled until now, because the board may not have received a Stop.
        """
        heard_s = max(self._heard_at_s, self._lost_s)
        if self._at_s > -math.inf:
            self._advance(heard_s + self._unheard_s)
        for index, speed_mps in enumerate(self._may_roll_mps):
            self._motion.shift(index, 0.0, speed_mps * (now - heard_s))
        self._at_s = self._heard_at_s = now
        self._lost_s = -math.inf
        # The next 0x20 is compared with the present state, not with that before the silence.
        self._comparison.begin_odometry()

    def _advance(self, now: float) -> None:
        since_s = max(now - 0.5, self._advanced_s) if self._at_s == -math.inf else self._at_s
        if self._estimated and now > since_s:
            self._estimated = False
            for wheel in self._motion.wheels:
                wheel.blind = False
        self._motion.advance(since_s, now)
        self._at_s = self._advanced_s = max(now, self._at_s)

    @property
    def _blind(self) -> bool:
        """Whether the ticks of at least one wheel do not show the wheel's motion.

        The board may count no ticks (``Wheel.blind``), or may count backward motion as forward
        after a new set-point.
        """
        return not self._motion.signed and any(
            wheel.blind or (wheel.rolls_on and wheel.rolls_on_s) for wheel in self._motion.wheels
        )

    def _estimate(self) -> FusedOdometry:
        self._estimated = True
        return self.estimates.conclude(self._at_s, self._may_roll_mps)
