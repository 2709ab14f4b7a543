# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Where the robot is, from what a LOIS ECU tells and what it was commanded.

No source tells all. 0x12's ticks are right to a tick, but the public firmware counts them only
while a wheel is commanded forward. 0x20's heading is integrated from whole RPM that are rounded
towards zero; its position does not move at equal speeds, so it tells the least that was driven. The
commands tell the rest. For each wheel, in each interval between two groups of ticks:

* its ticks count (by the commands, or ticks of this board were seen to go backwards): by them;
* it is blind and the other one counts: the other way, and 0x20's change of heading;
* both are blind: the change of heading, and the mean by a model of the commanded speed, which
  0x20's velocity corrects whenever it tells one.

Errors that stay the same (the model's gain, the rounding of RPM) are kept as levers on the pose,
so that they grow with the way; those of single intervals as a walk. Time is an argument.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu.messages import BoardOdometry, SetDuty, SetRpm, Ticks
from omnibot_driver.core.lois_ecu.plausibility import wrapped
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.wheel_model import Expected, WheelModel
from omnibot_driver.core.odometry.covariance import Covariance, OdometryNoise, Uncertainty

Source = Literal["standing", "ticks", "ticks and heading", "commands and heading", "commands"]
"""What the last interval is known by."""

NEAR_S: Final = 0.1
"""0x20 that came so long before or after the ticks belongs to them."""
FIRMWARE_GAIN: Final = 1.09
"""Backwards, the firmware lowers its target with each tick, until the controller's next step."""
GAIN_STDDEV: Final = 0.05
GAIN_MEASURED_STDDEV: Final = 0.03
GAIN_FLOOR: Final = 0.025
DUTY_STDDEV: Final = 0.3
ROUNDING_STDDEV: Final = 0.015
"""Of the turn that 0x20 tells, after half an RPM was added to each wheel."""
UNSTEADY: Final = 0.55
"""Part of a blind change of speed that the model may be off by."""
TRANSITION_S: Final = 0.06
HALF_RPM: Final = 0.5
LONGEST_STEP_S: Final = 2.0
STARTING_TICKS: Final = 1.2
STARTING_STDDEV: Final = 0.8
"""What 0x20 lacks of a wheel that starts: the tick that takes the whole rest has no speed."""
LEAP_RAD: Final = 0.25
LEAP_PART: Final = 0.6
MISSED_RAD: Final = 1.0
"""0x20's heading is believed if it is off the model by no more than this, by this part of the turn,
and by this where an interval went without it."""
CHANGING_PART: Final = 0.12
TOLD_PART: Final = 0.5
"""0x20's speeds leave so much of the model's error, where they are used."""
TOLD_AT_MOST: Final = 1.5
"""More than the model's way so many times is a leap of 0x20, not motion: it takes a speed from
before a rest for that of the whole rest."""
ALL_OF: Final = 0.95
BENT_PART: Final = 0.1
"""Of the variance of the way times that of the heading."""
HIDDEN_BY_TICKS: Final = 1 / 24
HIDDEN_BY_HEADING: Final = 1 / 6
"""Variance in squared ticks, of the way by two counts, or by one and a heading."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoisOdometrySettings:
    """``noise``: of the wheels on the ground; its ``wheels`` are replaced by the board's own."""

    wheel_drift: float = 0.0035
    wheel_scale: float = 0.01
    wheel_slip: float = 0.005


@dataclass(frozen=True, slots=True)
class FusedOdometry:
    """At ``stamp_s``: pose and covariance in the odometry frame, twist in the body's.

    ``displacement``: since the one before, in the robot's own axes. ``predicted``: nothing was
    heard of this time yet. ``blind``: the board told nothing of some of the motion.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist
    covariance: Covariance
    twist_covariance: tuple[float, float]
    displacement: Pose
    wheel_ways_m: tuple[float, float]
    source: Source
    predicted: bool = False

    @property
    def blind(self) -> bool:
        """Whether the motion is known by commands and not by measurement."""
        return self.source in ("commands", "commands and heading")


@dataclass(slots=True)
class _Way:
    """Of one wheel. ``measured``: by ticks; else by the model."""

    way_m: float
    measured: bool


class LoisOdometry:
    """``settings`` of the board; wheels are left, right. All times are arrival times."""

    def __init__(
        self, settings: LoisEcuSettings, noise: LoisOdometrySettings | None = None
    ) -> None:
        self._noise = LoisOdometrySettings() if noise is None else noise
        self._models = (WheelModel(0.0), WheelModel(0.0))
        self._uncertainty = Uncertainty(OdometryNoise())
        self.configure(settings)
        self.blind_way_m = 0.0
        """Rolled by the middle of the axle while nothing measured it."""
        self.signed_ticks = False
        """Ticks of this board were seen to go backwards: they always count."""
        self._appends = False
        self._gain_variance = GAIN_STDDEV**2
        self._gain = 1.0
        self._set_gain(1.0)
        self._last_ticks: Ticks | None = None
        self._at_s = -math.inf
        self._board: BoardOdometry | None = None
        self._board_at_s = -math.inf
        self._board_used: BoardOdometry | None = None
        self._missed_rad, self._missed = 0.0, False
        """Turned since 0x20 was used last; whether an interval had to go without it."""
        self._twist = BodyTwist(0.0, 0.0, 0.0)
        self.reset()

    def configure(self, settings: LoisEcuSettings) -> None:
        """From the next group on."""
        self._settings = settings
        self._wheels = DifferentialKinematics(wheel_radius_m=1.0, track_m=settings.track_m)
        noise = OdometryNoise(
            wheel_drift=self._noise.wheel_drift,
            wheel_scale=self._noise.wheel_scale,
            wheel_slip=self._noise.wheel_slip,
            wheels=self._wheels,
        )
        self._uncertainty.noise = noise
        for model in self._models:
            model.rounding_mps = HALF_RPM * settings.rim_mps_per_rpm

    @property
    def yaw_rad(self) -> float:
        """Of the last estimate."""
        return self._pose.yaw_rad

    @property
    def counting(self) -> bool:
        """Whether this board counts the ticks of both wheels now."""
        return self.signed_ticks or all(model.counting for model in self._models)

    @property
    def appends(self) -> bool:
        """Whether this is the public firmware, or one like it."""
        return self._appends

    @property
    def standing(self) -> bool:
        """Whether nothing is commanded and the model has come to rest."""
        return all(not model.speed_mps and not model.target_mps for model in self._models)

    def reset(self) -> None:
        """The odometry frame begins where the robot stands."""
        self._pose = Pose()
        self._uncertainty = Uncertainty(self._uncertainty.noise)
        self._walk: list[tuple[float, float, float, float]] = []
        self._extra = Covariance.diagonal(0.0, 0.0)
        self._levers = {"gain": (0.0, 0.0, 0.0), "rounding": (0.0, 0.0, 0.0)}

    def connect(self) -> None:
        """The line is new: counters may have begun anew, the pose goes on."""
        self._last_ticks = self._board = self._board_used = self._pending = None
        self._missed_rad, self._missed = 0.0, False
        self._at_s = self._board_at_s = -math.inf

    # What goes out

    def wrote(self, command: SetRpm | SetDuty, now: float) -> None:
        """A set-point went to the board."""
        settings = self._settings
        if isinstance(command, SetRpm):
            unit = settings.rim_mps_per_rpm
            speeds = (command.left_rpm * unit, command.right_rpm * unit)
            for model, speed in zip(self._models, speeds, strict=True):
                model.command(now, "rpm", speed)
            return
        percents = (command.left_percent, command.right_percent)
        for model, percent in zip(self._models, percents, strict=True):
            model.command(now, "duty", percent / settings.duty_scale)

    def halted(self, now: float) -> None:
        """The board has set both set-points to zero by itself: its button."""
        self.wrote(SetRpm(0, 0), now)

    # What comes in

    def heard_odometry(self, group: BoardOdometry, now: float) -> list[FusedOdometry]:
        """0x20, or what came behind 0x12; completes the interval of ticks just before it."""
        self._board, self._board_at_s = group, now
        if group.appended and not self._appends:
            self._appends = True
            self._set_gain(FIRMWARE_GAIN)
        if self._board_used is None:
            self._board_used = group
        if self._pending is not None and now - self._at_s <= NEAR_S:
            return [self._complete(self._pending)]
        return []

    def heard_ticks(self, ticks: Ticks, now: float) -> list[FusedOdometry]:
        """0x12. The interval is not complete while 0x20 has to tell more, which ``rest`` ends."""
        found = self.rest(math.inf)
        before, from_s = self._last_ticks, self._at_s
        self._last_ticks, self._at_s = ticks, now
        if before is None:
            self._pending = None
            self._board_used = None
            for model in self._models:
                model.advance(now - 0.5, now)
            return found
        counted = (wrapped(ticks.left - before.left), wrapped(ticks.right - before.right))
        if any(
            abs(count) * self._settings.tick_m > 5.0 * (now - from_s) + 0.5 for count in counted
        ):
            counted = (0, 0)  # the counters began anew
        self.signed_ticks |= min(counted) < 0
        pending = _Interval(from_s, now, counted)
        if self._needs_heading(counted):
            self._pending = pending
            return found
        return [*found, self._complete(pending)]

    _pending: "_Interval | None" = None

    def rest(self, now: float) -> list[FusedOdometry]:
        """Nothing came until now: an interval that waited for 0x20 goes without."""
        if self._pending is not None and now - self._at_s > NEAR_S:
            return [self._complete(self._pending)]
        return []

    def predict(self, now: float) -> FusedOdometry | None:
        """Where it should be now; None before the first ticks."""
        if self._at_s == -math.inf:
            return None
        since_s = self._at_s if self._pending is None else self._pending.from_s
        duration_s = min(max(now - since_s, 0.0), LONGEST_STEP_S)
        left_m, right_m = (model.ahead(duration_s) for model in self._models)
        tangent = self._tangent(left_m, right_m)
        pose = self._pose.moved(roll(tangent))
        unsure = sum(
            abs(model.target_mps - model.speed_mps) * min(duration_s, 0.5) * 0.5
            for model in self._models
        )
        along_m = 0.1 * (abs(left_m) + abs(right_m)) / 2 + unsure / 2
        heading = pose.yaw_rad
        covariance = self._covariance().with_errors(
            [
                (along_m**2, math.cos(heading), math.sin(heading), 0.0),
                ((2 * along_m / self._settings.track_m) ** 2 / 4, 0.0, 0.0, 1.0),
            ]
        )
        return FusedOdometry(
            max(now, self._at_s),
            pose,
            self._twist_of_models(),
            covariance,
            self._twist_variances(),
            roll(tangent),
            (left_m, right_m),
            self._source,
            predicted=True,
        )

    _source: Source = "standing"

    # One interval

    def _needs_heading(self, counted: tuple[int, int]) -> bool:
        if self.signed_ticks:
            return False
        fresh = self._board is not None and self._at_s - self._board_at_s <= 0.02
        moving = any(
            (model.target_mps or model.speed_mps) and not model.counting for model in self._models
        )
        return moving and (self._appends or not fresh)

    def _complete(self, interval: "_Interval") -> FusedOdometry:
        self._pending = None
        duration_s = interval.to_s - interval.from_s
        began_s = max(interval.from_s, interval.to_s - LONGEST_STEP_S)
        left, right = self._models
        expected = (left.advance(began_s, interval.to_s), right.advance(began_s, interval.to_s))
        tick_m = self._settings.tick_m
        ways: list[float] = []
        blind: list[bool] = []
        for count, one in zip(interval.counted, expected, strict=True):
            way_m = count * tick_m
            is_blind = not self.signed_ticks and (one.blind_m != 0.0)
            if count > 0 and one.blind_s > ALL_OF * duration_s:
                is_blind = False  # it counts although it should not: somebody pushes
            ways.append(way_m + (one.blind_m if is_blind else 0.0))
            blind.append(is_blind)
        turned = self._turned(ways, blind, expected, interval)
        source = self._source_of(ways, blind, turned)
        errors = [0.0, 0.0]
        common_m = 0.0
        if turned is not None:
            ways, errors, common_m = self._with_heading(ways, blind, expected, turned, duration_s)
        else:
            for index in range(2):
                if blind[index]:
                    errors[index] = self._model_error(expected[index])
                    common_m += abs(expected[index].blind_m) / 2
        if any(blind):
            self.blind_way_m += common_m
            self._learn(expected, duration_s)
        tangent = self._tangent(ways[0], ways[1])
        self._move(tangent, errors, ways, expected, blind, turned)
        self._follow(ways, expected, blind, duration_s)
        self._source = source
        if self._board is not None and abs(self._board_at_s - interval.to_s) <= NEAR_S:
            self._board_used, self._missed_rad, self._missed = self._board, 0.0, False
        else:
            self._missed_rad += (ways[1] - ways[0]) / self._settings.track_m
            self._missed_rad -= self._lacking(ways, expected) if any(blind) else 0.0
            self._missed = True
        self._twist = self._twist_of_models()
        return FusedOdometry(
            interval.to_s,
            self._pose,
            self._twist,
            self._covariance(),
            self._twist_variances(),
            roll(tangent),
            (ways[0], ways[1]),
            source,
        )

    def _source_of(self, ways: list[float], blind: list[bool], turned: float | None) -> Source:
        if not any(blind):
            return "ticks" if any(ways) else "standing"
        if turned is None:
            return "commands"
        return "commands and heading" if all(blind) else "ticks and heading"

    def _turned(
        self,
        ways: list[float],
        blind: list[bool],
        expected: tuple[Expected, Expected],
        interval: "_Interval",
    ) -> float | None:
        """The change of heading by 0x20, if it is of use and can be true."""
        board, before = self._board, self._board_used
        if not any(blind) or board is None or before is None:
            return None
        if abs(self._board_at_s - interval.to_s) > NEAR_S:
            return None
        if not all(
            model.measuring or not one.blind_m
            for model, one in zip(self._models, expected, strict=True)
        ):
            return None
        turned = board.yaw_rad - before.yaw_rad - self._missed_rad
        by_model = (ways[1] - ways[0]) / self._settings.track_m
        missed = MISSED_RAD if self._missed else 0.0
        if abs(turned - by_model) > LEAP_RAD + LEAP_PART * abs(by_model) + missed:
            return None
        return turned + self._lacking(ways, expected)

    def _lacking(self, ways: list[float], expected: tuple[Expected, Expected]) -> float:
        """What 0x20's heading misses: fractions of an RPM, and the first tick after a rest."""
        track_m = self._settings.track_m
        left, right = (_sign(way) for way in ways)
        lacking = 0.0
        seconds = min(one.blind_s or math.inf for one in expected)
        if left * right < 0 and math.isfinite(seconds):
            lacking += right * 2 * HALF_RPM * self._settings.rim_mps_per_rpm * seconds / track_m
        lost_m = STARTING_TICKS * self._settings.tick_m
        for one, direction in zip(expected, (-left, right), strict=True):
            lacking += direction * lost_m / track_m if one.started else 0.0
        return lacking

    def _with_heading(
        self,
        ways: list[float],
        blind: list[bool],
        expected: tuple[Expected, Expected],
        turned: float,
        duration_s: float,
    ) -> tuple[list[float], list[float], float]:
        """Ways, standard deviations of each wheel alone, and the way by the model."""
        rim_m = turned * self._settings.track_m
        left_m, right_m = ways
        starting = sum(one.started for one in expected)
        unsure = STARTING_STDDEV * self._settings.tick_m * math.sqrt(starting)
        if self._missed and not all(blind):
            # The heading puts right what was turned before; the way is that of now.
            mean_m = (left_m + right_m) / 2
            error = max(self._model_error(one) for one in expected) + unsure
            errors = [error * blind[0], error * blind[1]]
            return [mean_m - rim_m / 2, mean_m + rim_m / 2], errors, 0.0
        if not blind[0]:
            return [left_m, left_m + rim_m], [0.0, unsure], 0.0
        if not blind[1]:
            return [right_m - rim_m, right_m], [unsure, 0.0], 0.0
        mean_m = (left_m + right_m) / 2
        board, before = self._board, self._board_used
        if board is not None and before is not None and left_m < 0 and right_m < 0:
            told_m = math.hypot(board.x_m - before.x_m, board.y_m - before.y_m)
            if told_m < TOLD_AT_MOST * -mean_m and not self._missed:
                mean_m = -max(-mean_m, told_m)
        error = max(self._model_error(one) for one in expected)
        told = self._told_speeds(board) if board is not None else None
        if told is not None and self._changing(told):
            before_mps = sum(one.from_mps for one in expected) / 2
            mean_m = (before_mps + sum(told) / 2) / 2 * duration_s
            error *= TOLD_PART
        return [mean_m - rim_m / 2, mean_m + rim_m / 2], [error, error], abs(mean_m)

    def _changing(self, told: tuple[float, float]) -> bool:
        """Whether 0x20's speeds tell more than the model: on the way to another speed."""
        for model, speed in zip(self._models, told, strict=True):
            if speed * model.target_mps <= 0 or not model.measuring:
                return False
        return any(
            abs(speed - model.final_mps) > CHANGING_PART * abs(model.final_mps)
            for model, speed in zip(self._models, told, strict=True)
        )

    def _model_error(self, expected: Expected) -> float:
        return UNSTEADY * expected.unsteady_m + TRANSITION_S * expected.changes_mps

    def _learn(self, expected: tuple[Expected, Expected], duration_s: float) -> None:
        """The gain backwards, and the speeds, by 0x20's velocity where it tells one."""
        board = self._board
        speeds = self._told_speeds(board) if board is not None else None
        if speeds is None or abs(self._board_at_s - self._at_s) > NEAR_S:
            return
        for model, speed, one in zip(self._models, speeds, expected, strict=True):
            if not one.blind_m or not model.measuring or not model.target_mps:
                continue
            if model.kind == "rpm" and self._at_s - model.steady_since_s > 2.0:
                told = (abs(speed) - model.rounding_mps) / abs(model.target_mps)
                if speed * model.target_mps > 0 and 0.7 < told < 1.4:
                    variance = self._gain_variance
                    part = variance / (variance + GAIN_MEASURED_STDDEV**2)
                    self._gain_variance = max(variance * (1 - part), GAIN_FLOOR**2)
                    self._set_gain(self._gain + part * (told - self._gain))
            elif speed * model.target_mps > 0:
                model.speed_mps += 0.7 * (speed - model.speed_mps)

    def _told_speeds(self, board: BoardOdometry) -> tuple[float, float] | None:
        """Of each rim at the last tick, signed, if 0x20 tells them."""
        forward = board.dx_mps * math.cos(board.yaw_rad) + board.dy_mps * math.sin(board.yaw_rad)
        turning = board.yaw_rate_radps * self._settings.track_m / 2
        if not (math.isfinite(forward) and math.isfinite(turning)) or not forward:
            return None
        half = HALF_RPM * self._settings.rim_mps_per_rpm
        left, right = forward - turning, forward + turning
        if max(abs(left), abs(right)) > 2.0:
            return None
        return left + half * _sign(left), right + half * _sign(right)

    def _set_gain(self, gain: float) -> None:
        self._gain = gain
        for model in self._models:
            model.gain_reverse = gain

    def _follow(
        self,
        ways: list[float],
        expected: tuple[Expected, Expected],
        blind: list[bool],
        duration_s: float,
    ) -> None:
        """The models take over what was measured."""
        if not duration_s:
            return
        for index, model in enumerate(self._models):
            if blind[index]:
                continue
            measured = ways[index] / duration_s
            steady = abs(measured - expected[index].way_m / duration_s)
            quantum = self._settings.tick_m / duration_s
            if steady > quantum:
                model.speed_mps += 0.8 * (measured - expected[index].way_m / duration_s)

    # Pose and covariance

    def _tangent(self, left_m: float, right_m: float) -> Pose:
        twist = self._wheels.body_twist((left_m, right_m))
        sign = -1.0 if self._settings.inverted else 1.0
        return Pose(twist.vx_mps, 0.0, sign * twist.yaw_rate_radps)

    def _move(
        self,
        tangent: Pose,
        errors: list[float],
        ways: list[float],
        expected: tuple[Expected, Expected],
        blind: list[bool],
        turned: float | None,
    ) -> None:
        track_m = self._settings.track_m
        before, after = self._pose, self._pose.moved(roll(tangent))
        dx_m, dy_m = after.x_m - before.x_m, after.y_m - before.y_m
        middle = before.yaw_rad + tangent.yaw_rad / 2
        cos, sin = math.cos(middle), math.sin(middle)
        gain, rounding = (0.0, 0.0), 0.0
        if turned is None:
            gain = (
                expected[0].blind_m if blind[0] else 0.0,
                expected[1].blind_m if blind[1] else 0.0,
            )
        else:
            rounding = turned * track_m
            if all(blind):
                mean_m = (ways[0] + ways[1]) / 2
                gain = (mean_m, mean_m)
        # A heading that is wrong by a part turns the blind wheel's way alone, or both by half.
        halves = (0.5, 0.5) if all(blind) else (float(blind[0]), float(blind[1]))
        for name, parts in (
            ("gain", gain),
            ("rounding", (-rounding * halves[0], rounding * halves[1])),
        ):
            x_m, y_m, yaw = self._levers[name]
            tilt = self._tangent(*parts)
            self._levers[name] = (
                x_m - dy_m * yaw + cos * tilt.x_m,
                y_m + dx_m * yaw + sin * tilt.x_m,
                yaw + tilt.yaw_rad,
            )
        self._uncertainty.move(before.yaw_rad, tangent)
        self._extra = self._extra.carried(dx_m, dy_m)
        # What a tick hides points elsewhere after a turn, and does not cancel with the next.
        part = HIDDEN_BY_HEADING if turned is not None else HIDDEN_BY_TICKS
        hidden = part * (self._settings.tick_m * min(abs(tangent.yaw_rad), 1.0)) ** 2
        if hidden:
            self._extra = self._extra.with_errors([(hidden, cos, sin, 0.0)])
        if any(errors):
            if turned is not None and all(blind):
                mean = max(errors)
                unsure = sum(one.started for one in expected) * (STARTING_STDDEV / track_m) ** 2
                turn = unsure * self._settings.tick_m**2
                self._extra = self._extra.with_errors(
                    [(mean * mean, cos, sin, 0.0), (turn, 0.0, 0.0, 1.0)]
                )
            else:
                for error, turn in zip(errors, (-1 / track_m, 1 / track_m), strict=True):
                    way = (error * error, cos / 2, sin / 2, turn)
                    self._extra = self._extra.with_errors([way])
        self._pose = after

    def _covariance(self) -> Covariance:
        """Also of what a tick hides, and of the stamp."""
        tick = self._settings.tick_m**2 / 12
        heading = self._pose.yaw_rad
        cos, sin = math.cos(heading), math.sin(heading)
        turn = 1 / self._settings.track_m
        late_m = 0.012 * abs(self._twist.vx_mps)
        late_rad = 0.012 * self._twist.yaw_rate_radps
        gain = self._gain_variance
        if any(model.kind == "duty" and model.target_mps for model in self._models):
            gain = DUTY_STDDEV**2
        whole = self._uncertainty.total(Pose()) + self._extra
        whole = whole.with_errors(
            [
                (gain, *self._levers["gain"]),
                (ROUNDING_STDDEV**2, *self._levers["rounding"]),
            ]
        )
        # A heading that is far off bends the way: the second order, which levers do not have.
        bent = BENT_PART * (whole.xx + whole.yy) * whole.yaw_yaw
        return whole.with_errors(
            [
                (bent, 1.0, 0.0, 0.0),
                (bent, 0.0, 1.0, 0.0),
                (tick, cos / 2, sin / 2, -turn),
                (tick, cos / 2, sin / 2, turn),
                (late_m**2, cos, sin, 0.0),
                (late_rad**2, 0.0, 0.0, 1.0),
            ]
        )

    def _twist_of_models(self) -> BodyTwist:
        left, right = self._models
        tangent = self._tangent(left.speed_mps, right.speed_mps)
        return BodyTwist(tangent.x_m, 0.0, tangent.yaw_rad)

    def _twist_variances(self) -> tuple[float, float]:
        """Of the speed in (m/s)² and the turning in (rad/s)²."""
        stddevs = [
            0.01 + 0.08 * abs(model.speed_mps) + 0.5 * abs(model.target_mps - model.speed_mps)
            for model in self._models
        ]
        speed = sum(stddev * stddev for stddev in stddevs) / 4
        return speed, 4 * speed / self._settings.track_m**2


@dataclass(frozen=True, slots=True)
class _Interval:
    """Between two groups of ticks; ``counted`` left, right."""

    from_s: float
    to_s: float
    counted: tuple[int, int]


def _sign(number: float) -> int:
    return (number > 0) - (number < 0)
