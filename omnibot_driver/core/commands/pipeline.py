# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The command pipeline: from a motion command to its set-point, expiry and supervision.

``interlocks.py`` decides whether the robot may be driven; this module does not know modes or
requests.
"""

import math
from collections.abc import Sequence
from enum import Enum

from omnibot_driver.core.board import Board
from omnibot_driver.core.commands.limits import require_timely
from omnibot_driver.core.commands.motion_interlock import MotionInterlock
from omnibot_driver.core.commands.policy import CommandPolicy
from omnibot_driver.core.commands.set_point_stream import PACE_S
from omnibot_driver.core.commands.set_points import GoalSetpoint, Setpoint
from omnibot_driver.core.commands.shaping import CommandShaper, ControlMethod
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.se2 import Pose, Signs
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.measurement.pipeline import Estimate
from omnibot_driver.core.motion_monitor.monitor import ADVICE, STOPPED, Fault, MotionMonitor
from omnibot_driver.core.motion_monitor.set_point_history import AT_REST
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.packets import Packets
from omnibot_driver.core.readings import DisplacementReading
from omnibot_driver.core.reporting.figures import CommandFigures
from omnibot_driver.core.requests import Request
from omnibot_driver.core.settings import SessionSettings

Command = tuple[Setpoint, float]
"""A motion that has passed the checks, and the time in s at which this motion expires."""


class CommandPipeline:
    """The path of motion commands in one session.

    * ``policy``: the command in effect, its expiry and the e-stop latch.
    * ``monitored``: whether the motion monitor is enabled.
    * ``obeys``: whether a board obeys the commands; False while a recording is played back.
    """

    def __init__(
        self,
        board: Board,
        odometry: Odometry,
        settings: SessionSettings,
        axis_signs: Signs,
        control: ControlMethod | None,
        *,
        obeys: bool,
    ) -> None:
        proof = StopProof(board.traits.stands_after_s)
        self._actuator = board.actuator(proof)
        self.policy = CommandPolicy(settings.commands, self._actuator, proof)
        self._odometry = odometry
        self.shaper = CommandShaper(
            board,
            self._actuator,
            odometry,
            settings.limits,
            settings.kinematics,
            axis_signs,
            control,
        )
        self.interlock = MotionInterlock(starts=Request.START in board.traits.requests)
        self._board, self._axis_signs = board, axis_signs
        self._monitor = MotionMonitor(board.traits.slack_mps, board.traits.slack_radps)
        self._advice = {**ADVICE, **board.traits.advice}
        self.obeys = obeys
        self.monitored = settings.motion_monitor

    def configure(self, settings: SessionSettings, now: float) -> list[str]:
        """Apply new settings to later commands and frames; return notices for the user.

        A stricter limit or timeout stops a motion in progress, except a drive to a goal.
        """
        if settings.motion_monitor is not self.monitored:
            self.monitored = settings.motion_monitor
            self._monitor.begin()
            self.interlock.start()
        limits, commands = settings.limits, settings.commands
        stricter = commands.timeout_s < self.policy.settings.timeout_s or limits.stricter_than(
            self.shaper.limits
        )
        self.interlock.expire(now, self.policy.settings.timeout_s)
        self.shaper.limits, self.shaper.kinematics = limits, settings.kinematics
        self.policy.configure(commands)
        current = self.policy.current
        if not stricter or current is None or current.is_zero or isinstance(current, GoalSetpoint):
            return []
        self.policy.halt(now)
        return ["robot stopped because a limit was lowered; send a new command"]

    def check_anew(self, now: float) -> list[str]:
        """Encode the current command with the board's new settings; return notices for the user.

        The robot is stopped if the encoding fails, or if the settings turn a standstill into a
        motion.
        """
        current = self.policy.current
        if current is None:
            return []
        stood = current.is_zero
        try:
            current.check_anew()
        except CommandRefused as error:
            self.policy.halt(now)
            return [
                f"robot stopped: the current command does not fit the new settings ({error}); send"
                " another command"
            ]
        # This motion has not been checked.
        if stood and not current.is_zero:
            self.policy.halt(now)
        return []

    def figures(self, now: float) -> CommandFigures:
        """Return the topic that commands the robot, and the counters of commands."""
        current = self.policy.current
        return CommandFigures(
            source=current.authority.value if current else None,
            age_s=now - self.policy.commanded_at,
            limited=self.shaper.limited,
            estop=self.policy.latched,
            monitored=self.monitored or not self.obeys,
            trips=self.interlock.trips,
            interlock=self.interlock.reason(now, self.policy.settings.timeout_s),
        )

    def begin(self, now: float) -> None:
        """Discard the current command. The motion monitor forgets earlier commands and motion."""
        self.policy.discard(now)
        self._monitor.begin()

    def release(self, now: float) -> None:
        """Release the e-stop."""
        self.policy.release(now)
        self.interlock.release()
        self._monitor.release()

    def twist(self, twist: BodyTwist, now: float, *, age_s: float) -> Command:
        """Return the command for a body velocity.

        ``age_s``: age of the sender's stamp in s; it shortens the time to expiry. Raises
        CommandRefused if the stamp or the velocity is not allowed.
        """
        timeout_s = self.policy.settings.timeout_s
        expires_at = now + timeout_s
        if age_s:
            require_timely("cmd_vel", age_s, timeout_s)
            expires_at -= max(0.0, age_s)
        motion = self.shaper.base(twist, before=self.policy.current, since=now - PACE_S)
        return motion, expires_at

    def wheels(self, rates_radps: Sequence[float], now: float, *, by: Enum) -> Command:
        """Return the command for wheel rates in rad/s, in the sequence of ``Traits.wheels``."""
        return self.shaper.wheels(rates_radps, by=by), now + self.policy.settings.timeout_s

    def pose(self, goal: Pose) -> Command:
        """Return the command to drive to ``goal``. The command never expires.

        ``goal``: a pose in the odometry frame.
        """
        return self.shaper.pose(goal, before=self.policy.current), math.inf

    def wrote(self, packets: Packets, now: float) -> None:
        """Record that packets of a request, such as a start, were sent. These command no motion."""
        self._actuator.wrote(packets, now)

    def said(self, now: float) -> None:
        """Tell the motion monitor the last set-point; during a drive to a goal, tell it None."""
        goal = isinstance(self.policy.current, GoalSetpoint)
        self._monitor.set_point(None if goal else self._actuator.commanded, now)

    def look(
        self, reading: DisplacementReading, estimates: Sequence[Estimate], now: float
    ) -> list[str]:
        """Compare the robot's motion with the commands; return notices for the user."""
        self.policy.proof.look(reading, now)
        fault = self._check(reading, estimates, now) if self.monitored and self.obeys else None
        return self._react_to(fault, now) + self.check_goal(estimates, now)

    def count_refused(self, count: int, now: float) -> list[str]:
        """React to rejected displacements; return notices for the user.

        Several in a row are a fault. ``count``: number of rejected displacements since the driver
        began.
        """
        if not (self.monitored and self.obeys):
            self._monitor.disregard_refused(count)
            return []
        return self._react_to(self._monitor.count_refused(count, now), now)

    def _check(
        self, reading: DisplacementReading, estimates: Sequence[Estimate], now: float
    ) -> Fault | None:
        """Return the fault that the robot's newest measured motion shows, or None.

        The motion comes from the newest estimate if it contains one, otherwise from ``reading``.
        """
        if not reading.possible:
            return self._monitor.count_impossible(now)
        seconds = reading.duration_s
        if not seconds or reading.restarted or not reading.measured:
            self._monitor.begin()
            return None
        if self.policy.current is None:
            self._monitor.set_point(AT_REST, now)
        newest = estimates[-1] if estimates else None
        if isinstance(newest, OdometryEstimate) and newest.rolling is not None:
            known = reading.frame == "body" or self._odometry.heading_known
            return self._monitor.check(newest.rolling, seconds, newest.stamp_s, heading_known=known)
        motion = Pose(reading.dx_m, reading.dy_m, reading.dyaw_rad).over(seconds)
        known = reading.frame == "body"
        return self._monitor.check(motion, seconds, now, heading_known=known)

    def _react_to(self, fault: Fault | None, now: float) -> list[str]:
        """React to a fault that the motion monitor has found; return notices for the user.

        Some faults stop the robot.
        """
        if fault is None:
            return []
        advice = self._advice.get(fault, "")
        if fault in STOPPED:
            self.policy.halt(now)
            self.interlock.trip(now)
            seen = "" if fault is Fault.BEYOND_LIMITS else self._seen()
            until = self.interlock.until.value
            if self._board.advice:
                advice = f"{self._board.advice}; if this does not help, {advice}"
            return [
                f"{fault.value}{seen}; robot stopped: {advice}; if the fault comes and goes, check"
                f" the cable to the board. {until}"
            ]
        if fault is Fault.UNCOMMANDED:
            self.policy.halt(now)
        said = f"{fault.value}: {advice}" if advice else fault.value
        return [said] if self._monitor.is_news(fault) else []

    def _seen(self) -> str:
        """Return the commanded and the measured twist as text, in REP-103's axes."""
        x, y, yaw = self._axis_signs
        commanded, measured = (
            f"{x * twist.vx_mps:.2f}, {y * twist.vy_mps:.2f} m/s, {yaw * twist.yaw_rate_radps:.2f}"
            " rad/s"
            for twist in (self._monitor.commanded, self._monitor.measured)
        )
        return f" (commanded {commanded}; measured {measured})"

    def stop_unheard(self, unheard_s: float, now: float) -> list[str]:
        """Stop the robot, because the board has sent nothing for ``unheard_s``; return notices.

        Only a discarded goal needs a notice. For other motions, the driver reports the refusal of
        the next command.
        """
        had_goal = isinstance(self.policy.current, GoalSetpoint)
        self.policy.halt(now)
        if not had_goal:
            return []
        return [
            f"the goal of cmd_pose is discarded: no data from the board for {unheard_s:g} s; check"
            " its power and cable, then send the goal again"
        ]

    def end_goal(self, now: float) -> list[str]:
        """Drop the goal or the docking for a zero ``cmd_vel`` that was refused; return notices.

        The goal stays if the board's control switch is set to position control, because ``cmd_vel``
        then has no effect.
        """
        goal = isinstance(self.policy.current, GoalSetpoint)
        motion = "goal" if goal else self._board.own_motion
        if not motion or not self.shaper.takes_velocities:
            return []
        self.policy.halt(now)
        ended = "the goal of cmd_pose is discarded" if goal else f"the {motion} is cancelled"
        return [
            f"{ended}: cmd_vel commanded the robot to stand still. Such a command ends the"
            f" {motion} even if it is refused, like this one"
        ]

    def check_goal(self, estimates: Sequence[Estimate], now: float) -> list[str]:
        """Drop the goal if it is invalid, or if the robot drives away from it; return notices.

        A change of the odometry frame's origin or scale makes a goal invalid.
        """
        goal = self.policy.current
        if not isinstance(goal, GoalSetpoint):
            return []
        if goal.alignment != self._odometry.alignments:
            why = (
                "the origin or a scale of odom has changed (cause: ~/reset_odometry, a restart of"
                " the board, `odom_linear_scale` or `odom_angular_scale`)"
            )
        elif self.obeys and any(
            goal.is_left_by(estimate.pose)
            for estimate in estimates
            if isinstance(estimate, OdometryEstimate)
        ):
            why = (
                "the robot is moving away from the goal; check that the board's switch is set to"
                " positional control"
            )
            if self.monitored:
                self.interlock.trip(now)
                why += f". {self.interlock.until.value}"
        else:
            return []
        self.policy.halt(now)
        return [f"the goal of cmd_pose is discarded: {why}"]
