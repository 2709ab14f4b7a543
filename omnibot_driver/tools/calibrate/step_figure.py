# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The picture of ``calibrate step``.

It shows the measured responses, and the predicted responses with the current and the better gains.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from omnibot_driver.tools.calibrate.step_models import SPAN_S
from omnibot_driver.tools.calibrate.wheel_loop import TICK_S, Gains, Motor, answer

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from omnibot_driver.tools.calibrate.step_fit import WheelFound

SHOWN_S: Final = 0.8
PREDICTED_TICKS: Final = 60


def draw(figure: "Figure", wheels: "Sequence[WheelFound]", now: Gains, better: Gains) -> None:
    """Draw the measured responses on the left, and the predicted ones on the right."""
    halves: Any = figure.subfigures(1, 2)
    left, right = halves
    measured: Any = left.subplots(len(wheels), 1, sharex=True, squeeze=False)
    for axes, wheel in zip(measured[:, 0], wheels, strict=True):
        _draw_wheel(axes, wheel)
    measured[0, 0].set_title(
        "Measured speed as a fraction of the step (mean over 40 ms)", fontsize=10
    )
    measured[-1, 0].legend(fontsize=7, loc="lower right")
    measured[-1, 0].set_xlabel(
        "time from the control tick to the middle of the averaged 40 ms, in ms"
    )
    command, load = right.subplots(2, 1, sharex=True)
    motors = [wheel.motor for wheel in wheels]
    _draw_predictions(command, motors, now, better, command=1.0, load=0.0)
    command.set_title("Predicted: a step of the commanded speed", fontsize=10)
    command.set_ylabel("fraction of the step")
    command.legend(fontsize=7, loc="lower right")
    _draw_predictions(load, motors, now, better, command=0.0, load=1.0)
    load.set_title("Predicted: a load that would slow the wheel by 1 count per tick", fontsize=10)
    load.set_ylabel("counts per tick")
    load.set_xlabel("time after the control tick, in ms")


def _draw_wheel(axes: "Axes", wheel: "WheelFound") -> None:
    gain = wheel.answer.values[0]
    for step in wheel.steps:
        part = (step.rate_radps / gain - step.before_radps) / (step.after_radps - step.before_radps)
        axes.plot(_middles_ms(step.end_ticks * TICK_S), part, ".", color="0.6", markersize=3)
    end_s = np.arange(0.0, SHOWN_S, TICK_S)
    for fit, style in ((wheel.first, ":"), (wheel.second, "--"), (wheel.motor_fit, "-")):
        mean = fit.model.mean(fit.values[1:], end_s)
        axes.plot(_middles_ms(end_s), mean, style, linewidth=1, label=fit.model.title)
    axes.set_xlim(-100, 1000 * SHOWN_S - 100)
    axes.set_ylabel(f"wheel {wheel.name}")
    axes.grid(alpha=0.3)


def _middles_ms(end_s: Any) -> Any:
    return 1000 * (end_s - SPAN_S / 2)


def _draw_predictions(
    axes: "Axes",
    motors: Sequence[Motor],
    now: Gains,
    better: Gains,
    *,
    command: float,
    load: float,
) -> None:
    """Draw each motor's predicted response with the current and with the better gains.

    ``command``: step of the commanded speed. ``load``: simultaneous step of the load, as the loss
    of speed that it would cause. Both are in counts per tick.
    """
    times_ms = 1000 * TICK_S * (np.arange(PREDICTED_TICKS) + 0.5)
    for name, gains, colour in (("now", now, "C0"), ("better", better, "C1")):
        label: str | None = (
            f"{name}: K_ff {gains.feed_forward:.1f}, K_VP {gains.proportional:.1f},"
            f" K_VI {gains.integral:.1f}"
        )
        for motor in motors:
            effort = load * motor.pwm_per_count
            speed = answer(motor, gains, PREDICTED_TICKS, command=command, load=effort)
            axes.plot(times_ms, speed, color=colour, linewidth=1, label=label)
            label = None
    axes.axhline(command, color="0.5", linewidth=0.5)
    axes.grid(alpha=0.3)
