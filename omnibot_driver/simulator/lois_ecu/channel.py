# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One wheel as the board sees it. Input: encoder edges; output: ticks, speed and motor duty.

This module does not know the protocol.
"""

from math import copysign

from omnibot_driver.simulator.common.casts import to_int32
from omnibot_driver.simulator.lois_ecu.motors import Gains, SpeedController
from omnibot_driver.simulator.lois_ecu.settings import Quirks

TIMER_US = 100
SLOW_TIMER_US = 7251 / 72
TIMER_COUNTS = 0x10000
SHORTEST_PER_TURN_US = 300_000
"""Time in µs of one turn at 200 RPM, the highest speed that the board can measure. An encoder
level gives no speed if it is shorter than this time divided by the edges per turn."""
LIMIT_RPM = 50
LIMIT_PERCENT = 100
RECORD_DEPTH = 1024
STALE_S = 0.25


class WheelChannel:
    """One wheel of the board, with its encoder counter and its speed controller.

    * ``corrections``: factors for the durations of the encoder's short and long level.
    * ``steps``: encoder edges per turn.
    * ``ticks``: encoder ticks, as 0x12 reports them.
    * ``open_loop``: whether a duty is commanded, not a speed.
    * ``record_left``: samples that the record in progress still needs.
    """

    def __init__(
        self, quirks: Quirks, steps: int, corrections: tuple[float, float], gains: Gains
    ) -> None:
        self._quirks, self._steps = quirks, steps
        self._timer_us = SLOW_TIMER_US if quirks.slow_timer else TIMER_US
        self._shortest_us = SHORTEST_PER_TURN_US / steps
        self.short_correction, self.long_correction = corrections
        self.controller = SpeedController(gains)
        self.ticks = 0
        self.rpm = 0
        self.exact_rpm = 0.0
        self.duty_percent = 0
        self.open_loop = False
        self._target = self._next_target = 0
        self._count = 0
        self._ticked_s = 0.0
        self.turned_ticks = 0
        """Encoder ticks that the board's odometry has not used yet; negative if the wheel truly
        turned backward."""
        self.record: list[int] = []
        self.record_left = 0
        self._records_torque = False

    # Encoder input

    def edge(self, at_s: float, is_long: bool, direction: int) -> None:
        """Process one edge of the encoder. Its interrupt is served at ``at_s``.

        ``is_long``: whether a long level ended. ``direction``: 1 forward, -1 backward.
        """
        quirks = self._quirks
        if not quirks.ticks_of_forward_targets:
            self.ticks += direction
        elif self._target > 0:
            self.ticks += 1
        elif self.duty_percent < 0 and (
            quirks.duty_drags_target if self.open_loop else quirks.reverse_runs_fast
        ):
            self._target -= 1
        self.turned_ticks += direction
        count = int(at_s * 1e6 / self._timer_us) % TIMER_COUNTS
        passed_us = (count - self._count) % TIMER_COUNTS * TIMER_US
        self._count, self._ticked_s = count, at_s
        correction = self.long_correction if is_long else self.short_correction
        passed_us = to_int32(passed_us * correction)
        self.rpm, self.exact_rpm = 0, 0.0
        measures = self._target != 0 or not quirks.sign_of_command
        if passed_us > self._shortest_us and measures:
            exact = 60e6 / (passed_us * self._steps)
            sign = self._target if quirks.sign_of_command else direction
            self.exact_rpm = copysign(exact, sign)
            self.rpm = int(copysign(int(exact), sign))
        records = self.record_left and not self._records_torque
        if records and passed_us > self._shortest_us and len(self.record) < RECORD_DEPTH:
            unit_us = 100 if quirks.records_in_100_us else 0.1
            self._sample(min(int(passed_us / unit_us), 0xFFFF))

    def settle(self, now_s: float) -> None:
        """Set the measured speed to zero if the last edge is more than ``STALE_S`` ago.

        The manual implies this. With the quirk ``keeps_speed_of_stalled_wheel``, the speed stays.
        """
        if not self._quirks.keeps_speed_of_stalled_wheel and now_s - self._ticked_s > STALE_S:
            self.rpm, self.exact_rpm = 0, 0.0

    # Records

    def start_record(self, samples: int, *, torque: bool) -> None:
        """Start a record of ``samples`` samples, and discard the previous record."""
        if not self._quirks.large_records_never_end:
            samples = min(samples, RECORD_DEPTH)
        self.record, self.record_left = [], samples
        self._records_torque = torque

    def torque(self) -> None:
        """Record one torque sample, if a torque record is running."""
        if self.record_left and self._records_torque and len(self.record) < RECORD_DEPTH:
            self._sample(200 + 25 * abs(self.duty_percent))

    def _sample(self, value: int) -> None:
        self.record.append(value)
        self.record_left -= 1

    # Commands

    def command_rpm(self, rpm: int) -> None:
        """Set the speed target in RPM (closed loop).

        If the target becomes zero or changes its sign, duty, measured speed and controller are
        reset.
        """
        self.open_loop = False
        if rpm == 0 or rpm * self._next_target < 0:
            self._halt()
        self._next_target = rpm

    def command_duty(self, percent: int) -> None:
        """Set the duty in percent (open loop). The speed target is kept."""
        self.open_loop = True
        self.controller.restart()
        self.duty_percent = max(-LIMIT_PERCENT, min(LIMIT_PERCENT, percent))

    def release(self) -> None:
        """Stop the motor, as the board does when its e-stop button is pressed or released.

        The button acts like a command of zero in the current mode, open or closed loop.
        """
        if self.open_loop:
            self.duty_percent = 0
        else:
            self._halt()
            self._next_target = 0

    def reset(self) -> None:
        """Set the ticks to zero.

        Without the quirk ``reset_clears_ticks_only``, also stop the motor.
        """
        self.ticks = 0
        if not self._quirks.reset_clears_ticks_only:
            self.command_duty(0)
            self._halt()
            self._next_target = 0

    def control(self) -> None:
        """Run one step of the speed controller. In open loop, nothing happens."""
        if self.open_loop:
            return
        target = self._next_target if not self._quirks.reverse_runs_fast else self._target
        if self._quirks.limits_rpm:
            target = max(-LIMIT_RPM, min(LIMIT_RPM, target))
        self.duty_percent = int(self.controller.step(float(self.rpm), float(target)))
        self._target = self._next_target

    def _halt(self) -> None:
        self.duty_percent = self._target = self.rpm = 0
        self.exact_rpm = 0.0
        self.controller.restart()
