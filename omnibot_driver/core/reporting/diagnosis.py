# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The diagnosis: a status for each part of the driver, with what an operator should do.

ERROR: the robot cannot or must not be used. WARN: check something. STALE: unknown.

This module knows figures and times; it does not know how the figures are obtained.
"""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.board import RateName
from omnibot_driver.core.reporting.figures import LinkFigures, Refusals, SessionFigures
from omnibot_driver.core.reporting.recent import RecentFigures
from omnibot_driver.core.reporting.status import RUNNING, Level, Status

RATE_TOLERANCE: Final = 0.05
STUCK_READINGS: Final = 100
LATE_S: Final = 0.005
"""Limit for the mean delay of reads, in s, above which the driver reports late reads. An adapter
that delivers bytes every 10 ms causes this mean delay, 5 ms."""
LARGEST_SKEW_PPM: Final = 115.0
"""Largest accepted difference in ppm between the rates of two crystal clocks."""
SKEW_KNOWN_S: Final = 75.0
"""Time in s after which the driver reports a clock skew above ``LARGEST_SKEW_PPM``. Late reads of a
busy computer disturb the estimate of the skew for this time at most."""

BUSY_SHARE: Final = 0.1
"""Share of time, from 0 to 1. If the reader thread waits for the processor for a larger share of
the time, the computer is reported as too busy."""

PUBLISHED_ODOMETRY: Final = "Published odometry (Hz)"
"""Label of the rate at which the driver publishes odometry. The label "Odometry rate (Hz)" is for
the rate at which odometry readings arrive."""
OF_KIND: Final[Mapping[RateName, tuple[str, ...]]] = {
    "IMU": ("IMU frames lost", "IMU readings refused"),
    "Odometry": ("Odometry frames lost", "Odometry readings refused"),
    "Pose": ("Poses refused",),
}
"""For each kind of reading: the labels of the figures that are left out if the board does not send
readings of that kind."""


class Diagnosis:
    """The diagnosis of one board, made about once a second from recent figures.

    * ``to_check``: what the user should check if no valid data comes from the board.
    """

    def __init__(self, to_check: str) -> None:
        self._to_check = to_check
        self._recent = RecentFigures()
        self._skewed_since = math.inf

    def judge(
        self, link: LinkFigures, session: SessionFigures, refusals: Refusals, now: float
    ) -> list[Status]:
        """Return all diagnostic statuses of the board.

        The names and the order of the statuses are the same in every call.
        """
        self._recent.remember(session, now)
        statuses = [
            self._link(link, now),
            self._board(link, session, now),
            self._stream(link, session, now),
            self._time(session, now),
            self._commands(session, refusals, now),
            self._estop(session),
        ]
        return [*statuses, self._imu(session)] if "IMU" in session.board.rates_hz else statuses

    def _link(self, link: LinkFigures, now: float) -> Status:
        reconnects = max(0, link.opened - 1)
        level, message = Level.OK, "connected"
        if link.trouble:
            level, message = Level.ERROR, link.trouble
        elif not link.opened:
            level, message = Level.STALE, "the port is being opened"
        elif self._recent.grew("reconnects", reconnects, now):
            level = Level.WARN
            message = (
                "the port was lost, but is open again; to prevent this, check cable, hub and power"
            )
        values = {
            "Port": link.port,
            "Connected": _yes(bool(link.opened) and not link.trouble),
            "Reconnects": str(reconnects),
            "Bytes received": str(link.received_bytes),
            "Bytes sent": str(link.sent_bytes),
            "Overruns": "not counted" if link.overruns is None else str(link.overruns),
            "Reader waited (s)": "" if link.waited_s is None else f"{link.waited_s:.1f}",
        }
        return Status("Link", level, message, values)

    def _board(self, link: LinkFigures, session: SessionFigures, now: float) -> Status:
        restarts = session.tally.restarts
        level, message = {
            "disconnected": (Level.STALE, "unknown while the port is closed"),
            "connecting": (
                Level.ERROR,
                f"no valid data from the board; check {self._to_check}",
            ),
            "paused": (Level.WARN, "paused; call ~/start to run it"),
            "imu_only": (
                Level.WARN,
                "the board is in IMU-only mode and sends no odometry; set the board to nominal mode"
                " and reboot it",
            ),
            "nominal": (Level.OK, "running"),
        }[session.state]
        if session.state == "connecting" and link.trouble:
            level, message = Level.STALE, "unknown while a port of the board is missing"
        if self._recent.grew("restarts", restarts, now) and level is Level.OK:
            level = Level.WARN
            message = "the board has restarted; if you did not reset it, check its power supply"
        if session.board.trouble and session.state in RUNNING:
            level, message = Level.ERROR, session.board.trouble
        values = {"Mode": session.state, "Restarts": str(restarts), **session.board.own}
        if session.task:
            values["Under way"] = session.task
        return Status("Board", level, message, values)

    def _stream(self, link: LinkFigures, session: SessionFigures, now: float) -> Status:
        tally, refused = session.tally, session.refused
        readings_refused = refused.imu + refused.displacements + refused.poses
        damaged = self._recent.grew("faults", session.board.faults, now)
        lossy = self._recent.grew("gaps", tally.gaps, now)
        overran = self._recent.grew("overruns", link.overruns or 0, now)
        waiting = self._recent.waiting_share(link, now)
        doubtful = self._recent.grew("refused", readings_refused, now)
        rates, wanted = self._recent.rates_hz(), session.board.rates_hz
        odom_hz = session.board.odom_hz
        level, message = Level.OK, "complete"
        if session.state not in RUNNING:
            level, message = Level.STALE, "the board sends no measurements"
        elif rates and any(
            abs(rates[name] - want) > RATE_TOLERANCE * want + 1.0 / self._recent.span_s
            for name, want in wanted.items()
            if name == "IMU" or session.state == "nominal"
        ):
            level = Level.WARN
            message = (
                f"frames arrive at wrong rates: the driver's reader waits {waiting:.0%} of the time"
                " for the processor; this computer is too busy: reduce its load"
                if waiting > BUSY_SHARE
                else "frames arrive at wrong rates: bytes are lost, or this computer is too busy to"
                " read them; check cable, hub and load"
            )
        elif overran:
            level = Level.WARN
            message = (
                "the serial port overran: bytes are lost in this computer, not on the line;"
                " reduce its load"
            )
        elif damaged or lossy:
            level, message = Level.WARN, "bytes are lost on the line: check cable, hub and ground"
        elif doubtful:
            level = Level.WARN
            message = (
                "implausible readings rejected: the line corrupts bits, or a motion limit"
                " (fastest_…) is set too low"
            )
        elif waiting > BUSY_SHARE:
            message = (
                "measurements are complete, but read late: the driver's reader waits"
                f" {waiting:.0%} of the time for the processor"
            )
        values = {
            **{
                f"{name} rate (Hz)": f"{rates[name] if rates else math.nan:.1f} of {want:g}"
                for name, want in wanted.items()
            },
            **({} if odom_hz is None else {PUBLISHED_ODOMETRY: f"{odom_hz:g}"}),
            "Framing faults": str(session.board.faults),
            "Bytes discarded": str(session.board.discarded_bytes),
            "IMU frames lost": str(tally.lost_imu),
            "Odometry frames lost": str(tally.lost_displacements),
            "Sequence gaps": str(tally.gaps),
            "Last gap (frames)": str(tally.last_gap),
            "IMU readings refused": str(refused.imu),
            "Odometry readings refused": str(refused.displacements),
            "Poses refused": str(refused.poses),
        }
        absent = [key for name in OF_KIND.keys() - wanted.keys() for key in OF_KIND[name]]
        return Status(
            "Stream",
            level,
            message,
            {key: value for key, value in values.items() if key not in absent},
        )

    def _time(self, session: SessionFigures, now: float) -> Status:
        skewed = session.state in RUNNING and abs(session.skew_ppm) > LARGEST_SKEW_PPM
        self._skewed_since = min(self._skewed_since, now) if skewed else math.inf
        delay = self._recent.delay_s()
        if session.state not in RUNNING or delay is None:
            return Status(
                "Time", Level.STALE, "the board sends no measurements, so its time is unknown", {}
            )
        delay_s, jitter_s = delay
        level, message = Level.OK, "stamps are sampling times"
        if now - self._skewed_since > SKEW_KNOWN_S:
            level = Level.WARN
            message = (
                "the clocks of this computer and of the board drift apart faster than crystal"
                " clocks do; check this computer's clock"
            )
        elif delay_s > LATE_S:
            level = Level.WARN
            message = (
                "measurements are read late; set the adapter's latency_timer to 1"
                " (udev/99-omnibot.rules), or reduce the load of this computer"
            )
        values = {
            "Clock skew (ppm)": f"{session.skew_ppm:.1f}",
            "Delay above minimum (ms)": f"{1e3 * delay_s:.2f}",
            "Jitter (ms rms)": f"{1e3 * jitter_s:.2f}",
        }
        return Status("Time", level, message, values)

    def _commands(self, session: SessionFigures, refusals: Refusals, now: float) -> Status:
        commands, saturated = session.commands, session.board.saturated
        refused = self._recent.grew("refusals", refusals.count, now)
        too_large = self._recent.grew("saturated", saturated, now)
        limited = self._recent.grew("limited", commands.limited, now)
        tripped = self._recent.grew("trips", commands.trips, now)
        level = Level.OK
        if commands.interlock:
            level, message = Level.ERROR, f"motion is refused: {commands.interlock}"
        elif tripped:
            level = Level.WARN
            message = "the motion monitor has stopped the robot; the log has the reason"
        elif not commands.monitored:
            level = Level.WARN
            message = "the motion monitor is off; set `motion_monitor` to true to turn it on"
        elif refused:
            level, message = Level.WARN, f"lately: {refusals.last}"
        elif too_large:
            level = Level.WARN
            message = (
                "commanded speeds are larger than a command to the board can hold; lower the scales"
                " or the speed limits"
            )
        elif commands.source is None:
            message = "idle"
        elif limited:
            message = f"{commands.source} exceeds the limits max_… and is reduced to them"
        else:
            message = f"{commands.source} is in control"
        values = {
            "Source": commands.source or "none",
            "Age (s)": f"{commands.age_s:.2f}" if commands.source else "none",
            "Refused": str(refusals.count),
            "Limited": str(commands.limited),
            "Saturated": str(saturated),
            "Motion monitor trips": str(commands.trips),
        }
        return Status("Commands", level, message, values)

    def _estop(self, session: SessionFigures) -> Status:
        level, message = Level.OK, "not latched"
        if session.commands.estop:
            level = Level.WARN
            message = (
                "latched; find the cause, then release it with the service ~/estop (data: false)"
            )
        return Status("E-stop", level, message, {"Latched": _yes(session.commands.estop)})

    def _imu(self, session: SessionFigures) -> Status:
        imu, tally = session.imu, session.tally
        stuck = [
            name
            for name, same in (("accelerometer", tally.same_force), ("gyro", tally.same_rate))
            if same >= STUCK_READINGS
        ]
        level, message = Level.OK, "measuring"
        if session.state not in RUNNING:
            level, message = Level.STALE, "the board sends no measurements"
        elif stuck:
            level = Level.ERROR
            message = (
                f"identical readings from the {' and '.join(stuck)}; switch the board off and on"
            )
        elif imu.advice:
            level, message = Level.WARN, imu.advice
        elif imu.gravity_mps2 is None:
            message = "measuring; gravity is not known until the robot is at rest"
        values = {
            "Gravity (m/s²)": "none" if imu.gravity_mps2 is None else f"{imu.gravity_mps2:.3f}",
            "Gyro bias (rad/s)": _numbers(imu.bias_radps),
            "Gyro noise (rad/s rms)": _numbers(imu.noise_radps),
            "Stuck": " and ".join(stuck) or "no",
        }
        return Status("IMU", level, message, values)


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _numbers(vector: tuple[float, float, float] | None) -> str:
    return "none" if vector is None else ", ".join(f"{value:.5f}" for value in vector)
