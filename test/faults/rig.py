# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A rig for tests of faults: a real driver process, a faulty line to the board, and a commander.

The rig checks the robot and the driver. The commander sends motion commands.
"""

import math
import os
import re
import subprocess
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, Self

from breakable_line import TICK_S, BreakableLine
from commander import Hand, Stick
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import PATIENCE_S, Driver
from nav_msgs.msg import Odometry
from ports import Terminal
from probe import Probe
from published import stamp_s
from rig_board import RigBoard
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, String

TIMEOUT_S: Final = 0.5
"""The driver's ``cmd_vel_timeout``, in s."""
GRACE_S: Final = 0.1
REST_S: Final = 1.0
FASTEST_MPS, FASTEST_RADPS = 2.0, 8.0
DRIVEN_MPS: Final = 0.6
NEW_VARIANCE, GAP_MPS2 = 1e-4, 2.5
"""Limits for the check of the odometry.

``NEW_VARIANCE``: largest variance of x just after a reset of odometry, in m².

``GAP_MPS2``: largest acceleration of the robot in a gap of the data, in m/s².
"""
WRONG_ONE_IN: Final = 500
"""The number N in "at most one of N published messages may be wrong", if bytes are damaged."""
ENDS_WITHIN_S: Final = 2.0


@dataclass(slots=True)
class Findings:
    """Results of the checks of a driver and its robot: failed checks, and counts of messages.

    ``complaints``: a text for each failed check.
    """

    complaints: list[str] = field(default_factory=list)
    stood_after_s: list[float] = field(default_factory=list)
    """For each stop, the time until the robot was at rest, in s of the board's clock."""
    published: int = 0
    wrong: int = 0

    def expect(self, holds: object, complaint: str) -> None:
        if not holds:
            self.complaints.append(complaint)

    def take(self) -> list[str]:
        """Remove and return the complaints since the last call."""
        complaints, self.complaints = self.complaints, []
        return complaints


class Rig:
    """Context manager that runs a driver and its simulated board.

    By default, the driver's port is a symbolic link to the board's terminal.

    ``before``: Python code that runs in the driver's process before the driver.

    ``grace_s``: time that is added to each time limit of a stop.

    ``ends_within_s``: time within which the driver must end.

    ``rest_s``: time for which the motors must be off until the robot is regarded as at rest.

    ``parameters``: further parameters of the driver.
    """

    def __init__(
        self,
        folder: Path,
        kind: RigBoard,
        *,
        grace_s: float = GRACE_S,
        ends_within_s: float = ENDS_WITHIN_S,
        rest_s: float = REST_S,
        before: str = "",
        settings: Any = None,
        **parameters: object,
    ) -> None:
        self.kind = kind
        self._grace_s = grace_s + kind.off_within_s
        self._ends_within_s = ends_within_s + kind.ends_later_s
        self._rest_ticks = round(rest_s / TICK_S)
        self._before, self._parameters = before, {**kind.parameters, **parameters}
        self.line: Any = (kind.line or BreakableLine)(kind, settings)
        self.findings = Findings()
        self.port = kind.port(folder)
        self._stack = ExitStack()
        self._unplugged_at_s: float | None = None
        self._terminal: Any = None

    def __enter__(self) -> Self:
        try:
            self._begin()
        except BaseException:
            self._stack.close()
            raise
        return self

    def _begin(self) -> None:
        self.plug()
        self._stack.callback(self.unplug)
        self.driver = self._stack.enter_context(
            Driver(before=self._before, **self.ports, **self._parameters)
        )
        self.probe = self._stack.enter_context(Probe.of(self.driver))
        self.imu = self.probe.listen(Imu, "imu/data_raw") if self.kind.imu else []
        self.odom = self.probe.listen(Odometry, "odom")
        self.states = self.probe.listen(String, "omnibot_driver/state", latched=True)
        self.estops = self.probe.listen(Bool, "omnibot_driver/estop_active", latched=True)
        self._diagnostics = self.probe.listen(DiagnosticArray, "/diagnostics")
        self.probe.wait_for_state("nominal")
        self.hand = self.make_hand()

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def make_hand(self) -> Hand:
        stick = Stick(self.probe)
        self._stack.callback(stick.leave)
        return stick

    # The line

    @property
    def ports(self) -> dict[str, str]:
        """Parameters that name the driver's ports."""
        return dict(self.kind.ports(self.port))

    @property
    def terminal(self) -> Terminal:
        """The terminal that is plugged in. Use this only for a board that has a terminal."""
        assert isinstance(self._terminal, Terminal)
        return self._terminal

    def heal(self) -> None:
        """End all faults of the line."""
        self.line.heal()
        assert self._terminal is not None
        self._terminal.deaf = False

    def unplug(self) -> None:
        """Disconnect the board from the driver, as if someone pulled the cable.

        The robot continues with its last command.
        """
        if self._terminal is not None:
            self._terminal.__exit__(None, None, None)
            self._terminal, self._unplugged_at_s = None, time.monotonic()

    def plug(self) -> None:
        """Make a new terminal, which has another name but the same symbolic link.

        First, simulate the board for the time since ``unplug``.
        """
        if self._unplugged_at_s is not None:
            for _ in range(round((time.monotonic() - self._unplugged_at_s) / TICK_S)):
                self.line.advance()
        self._terminal = self._make_terminal().__enter__()

    @property
    def terminal_lock(self) -> Any:
        """The lock that a test must hold while it changes the state of the simulated board."""
        return self._terminal.lock

    def _make_terminal(self) -> Any:
        if self.kind.serve is not None:
            return self.kind.serve(self.line, self.port)
        return Terminal(self.line, self.port)

    def reboot_board(self) -> None:
        """Turn the board's power off and on."""
        assert self._terminal is not None
        with self._terminal.lock:
            self.line.board.reboot()

    def wait_for_board(self, predicate: Any, patience_s: float = PATIENCE_S) -> bool:
        """Wait until ``predicate`` is true; return False on timeout.

        The condition is checked after each tick of the board.
        """
        assert self._terminal is not None
        return self._terminal.wait_for(predicate, patience_s)

    def wait_ticks(self, ticks: int) -> None:
        end = self.line.tick + ticks
        assert self.wait_for_board(lambda line: line.tick >= end), (
            "the ticks of the board do not advance"
        )

    # What can be seen

    def drive(self, vx: float = 0.3, vy: float = 0.0, yaw_rate: float = 0.2) -> None:
        """Let the commander send this motion, and wait until the motors turn."""
        self.hand.hold(vx, vy, yaw_rate)
        assert self.wait_for_board(lambda line: line.board.driven), self.driver.output

    def expect_still(self, since_tick: int, what: str, allowed_s: float = TIMEOUT_S) -> None:
        """Expect the motors to be off soon after ``since_tick``, and to stay off for ``rest_s``.

        ``allowed_s``: longest time from ``since_tick`` to standstill, without the rig's
        ``grace_s``.
        """
        allowed = since_tick + round(allowed_s / TICK_S)
        latest = allowed + round(self._grace_s / TICK_S)

        def is_decided(line: Any) -> bool:
            off_from = min(max(allowed, line.driven_at), latest)
            return bool(line.tick >= off_from + self._rest_ticks)

        assert self.wait_for_board(is_decided), self.driver.output
        stood_s = max(0, self.line.driven_at - since_tick) * TICK_S
        self.findings.stood_after_s.append(stood_s)
        self.findings.expect(
            stood_s <= allowed_s + self._grace_s,
            f"{what}: motors driven for {stood_s:.2f} s, allowed {allowed_s + self._grace_s:.2f} s",
        )

    def wait_for_diagnosis(self, pattern: str) -> None:
        """Wait for a new diagnostic status of this port whose message matches ``pattern``."""
        mark = len(self._diagnostics)
        self.probe.wait_for(
            lambda: any(
                status.hardware_id == self.ports["port"] and re.search(pattern, status.message)
                for message in self._diagnostics[mark:]
                for status in message.status
            )
        )

    def expect_said_once(self, pattern: str, mark: int) -> None:
        """Expect exactly one match of ``pattern`` in the log, from the line number ``mark`` on."""
        times = sum(bool(re.search(pattern, line)) for line in self.driver.lines[mark:])
        self.findings.expect(times == 1, f"the log says {times} times: {pattern}")

    def expect_ended(self, *exit_codes: int, late_s: float = 0.0) -> None:
        """Expect the driver to end in time with one of these exit codes.

        ``late_s``: additional time that the driver may take to end, in s.
        """
        begin_s = time.monotonic()
        try:
            code = self.driver.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.driver.process.kill()
            code = self.driver.process.wait()
        took_s = time.monotonic() - begin_s
        self.findings.expect(code in exit_codes, f"exit code {code}: {self.driver.output}")
        self.findings.expect(
            took_s < self._ends_within_s + late_s, f"it took {took_s:.1f} s to end"
        )

    def expect_moves_again(self) -> None:
        """Expect a fresh command to move the robot. Then the commands end."""
        self.probe.wait_for_state("nominal")
        self.drive()
        self.hand.leave()

    def expect_obeys_again(self) -> None:
        """Expect a fresh command to move the robot.

        When the commands end, expect the robot to stop.
        """
        self.expect_moves_again()
        self.expect_still(self.line.tick, "afterwards")

    def judge_stream(self, damaged_bytes: bool = False) -> None:
        """Expect that the driver has published only what the board sent.

        Odometry must not jump, timestamps must increase, and no reading may be rejected.

        ``damaged_bytes``: whether a few wrong messages and rejected readings are allowed.
        """
        imu, odom, sent = list(self.imu), list(self.odom), list(self.line.sent)
        one_in = WRONG_ONE_IN if damaged_bytes else math.inf
        for what, wrong, out in self.kind.not_sent(imu, odom, sent):
            self.findings.wrong += wrong
            self.findings.expect(
                wrong <= out / one_in, f"{wrong} of {out} {what} messages were never sent"
            )
        for before, after in pairwise(odom):
            seconds = stamp_s(after) - stamp_s(before)
            self.findings.expect(seconds > 0, f"stamps of odom {seconds:g} s apart")
            a, b = before.pose.pose.position, after.pose.pose.position
            step_m = math.hypot(b.x - a.x, b.y - a.y)
            c = before.pose.covariance
            doubt_m = self.kind.jump_stddevs * math.sqrt(c[0] + c[7])
            possible = step_m <= FASTEST_MPS * max(seconds, 0.04) + 0.005 + doubt_m
            zeroed = (
                math.hypot(b.x, b.y) < 0.05 + DRIVEN_MPS * seconds
                and after.pose.covariance[0] < NEW_VARIANCE + (GAP_MPS2 * seconds**2) ** 2
            )
            self.findings.expect(
                possible or zeroed,
                f"odom jumped by {step_m:.3f} m in {seconds:.3f} s, to {b.x:.3f} {b.y:.3f},"
                f" variance {after.pose.covariance[0]:.1e}",
            )
        refused = sum(
            int(number)
            for number in re.findall(r"implausible readings rejected: (\d+)", self.driver.output)
        )
        self.findings.expect(  # damaged bytes may look like a frame, so a few are allowed
            refused <= (len(imu) or len(odom)) / one_in,
            f"{refused} readings were rejected",
        )
        backwards = [(stamp_s(a), stamp_s(b)) for a, b in pairwise(imu) if stamp_s(b) <= stamp_s(a)]
        self.findings.expect(not backwards, f"imu stamps do not increase: {backwards[:9]}")
        self.findings.published += len(imu) + len(odom)

    def cost(self) -> tuple[int, int]:
        """Return the number of open descriptors, and the resident memory in kB."""
        folder = Path(f"/proc/{self.driver.process.pid}")
        status = (folder / "status").read_text()
        kilobytes = int(status.split("VmRSS:")[1].split()[0])
        return len(os.listdir(folder / "fd")), kilobytes
