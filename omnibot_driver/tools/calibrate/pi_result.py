# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The result of ``calibrate step`` with recorded ticks: printed table, saved file and picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from omnibot_driver.tools.calibrate.pi_loop import STEP_S, Loop, answer
from omnibot_driver.tools.calibrate.pi_tuning import SECONDS, Goals, Tuned, told
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.calibrate.tick_fit import Plant, PlantFit
from omnibot_driver.tools.calibrate.tick_records import Levels, Response

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN_S: Final = 2.5
WORSE: Final = 1.1
"""New gains are regarded as worse if the error of a step grows by more than this factor."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Several recorded steps of the set-point of one wheel, all with the same gains."""

    steps: list[Response]

    @property
    def final_rpm(self) -> float:
        """Mean final speed of the steps, in RPM."""
        return float(np.mean([one.rpm[-len(one.rpm) // 3 :].mean() for one in self.steps]))

    @property
    def overshoot(self) -> float:
        """Overshoot of the mean step, smoothed over 0.2 s, as a fraction of the final speed."""
        grid_s = np.arange(0.0, min(one.times_s[-1] for one in self.steps), 0.02)
        mean = np.mean([np.interp(grid_s, one.times_s, one.rpm) for one in self.steps], axis=0)
        calm = np.convolve(mean, np.full(10, 0.1), "valid")
        return max(float(calm.max()) / self.final_rpm - 1.0, 0.0)

    @property
    def error_s(self) -> float:
        """Mean over all steps of the time integral of the relative speed error, in s.

        The relative error is the absolute deviation from the final speed, divided by the final
        speed. The integral begins at the first smoothed speed (``Response.rpm``).
        """
        errors = []
        for one in self.steps:
            wrong = np.abs(one.rpm / self.final_rpm - 1.0)
            errors.append(float(np.sum((wrong[1:] + wrong[:-1]) / 2 * np.diff(one.times_s))))
        return float(np.mean(errors))


@dataclass(frozen=True, slots=True)
class WheelTuned:
    """The result of the tuning of one wheel.

    * ``fit``: the plant that was fitted to the starts at full duty.
    * ``plant``: the plant for which the gains were tuned.
    * ``before``, ``after``: steps with the previous and the new gains.
    """

    name: str
    levels: Levels
    fit: PlantFit
    plant: Plant
    loop: Loop
    tuned: Tuned
    before: Measured
    after: Measured

    @property
    def worse(self) -> bool:
        """Whether the wheel followed a step better with the previous gains."""
        return self.after.error_s > WORSE * self.before.error_s


def result_of(
    wheels: Sequence[WheelTuned], goals: Goals, parameters: Mapping[str, float]
) -> Result:
    """Return the result, which the tool shows and saves.

    ``parameters``: the parameters that the tool sets in the driver, and saves in the file.
    """
    return Result(
        findings=[row for wheel in wheels for row in _rows(wheel, goals)],
        parameters=dict(parameters),
        record={"step": {wheel.name: _recorded(wheel, goals) for wheel in wheels}},
        notes=[sentence for wheel in wheels for sentence in _remarks(wheel, goals)],
        draw=lambda figure: draw(figure, wheels),
    )


def _rows(wheel: WheelTuned, goals: Goals) -> list[Finding]:
    name, fit, plant, gains = wheel.name, wheel.fit, wheel.plant, wheel.tuned.gains
    predicted = told(plant, gains, wheel.loop, goals)
    rows: list[tuple[str, float, float | None, str]] = [
        ("short correction", wheel.levels.short, wheel.levels.sigma, ""),
        ("long correction", wheel.levels.long, wheel.levels.sigma, ""),
        ("speed at full duty", fit.final_rpm, fit.sigmas[0], "RPM"),
        ("gain", plant.rpm_per_percent, None, "RPM/%"),
        ("dead zone", plant.dead_zone_percent, None, "%"),
        ("slow time constant", fit.slow_s, fit.sigmas[1], "s"),
    ]
    if fit.order == 2:
        rows.append(("fast time constant", fit.fast_s, fit.sigmas[2], "s"))
    rows += [
        ("dead time", wheel.loop.dead_s, None, "s"),
        ("Kp", round(float(gains.kp), 4), None, "%/RPM"),
        ("Tn", round(float(gains.tn_s), 4), None, "s"),
        ("Td", round(float(gains.td_s), 4), None, "s"),
        ("phase margin", round(predicted.phase_margin_deg, 1), None, "degrees"),
    ]
    findings = [
        Finding(name=f"{name}: {what}", value=value, sigma=sigma, unit=unit)
        for what, value, sigma, unit in rows
    ]
    findings.append(
        Finding(
            name=f"{name}: overshoot, measured",
            value=round(100 * wheel.after.overshoot, 1),
            unit="%",
            before=round(100 * wheel.before.overshoot, 1),
        )
    )
    return findings


def _recorded(wheel: WheelTuned, goals: Goals) -> dict[str, Any]:
    predicted = told(wheel.plant, wheel.tuned.gains, wheel.loop, goals)
    return {
        "final_rpm": round(wheel.fit.final_rpm, 2),
        "time_constants_s": [round(wheel.fit.slow_s, 4), round(wheel.fit.fast_s, 4)],
        "dead_time_s": round(wheel.loop.dead_s, 4),
        "dead_zone_percent": round(wheel.plant.dead_zone_percent, 2),
        "overshoot_predicted": round(predicted.overshoot, 4),
        "overshoot_measured": round(wheel.after.overshoot, 4),
        "overshoot_before": round(wheel.before.overshoot, 4),
    }


def _remarks(wheel: WheelTuned, goals: Goals) -> list[str]:
    predicted = told(wheel.plant, wheel.tuned.gains, wheel.loop, goals)
    remarks = [
        f"The {wheel.name} wheel, with the new gains: a step to {wheel.tuned.target_rpm:.0f} RPM"
        f" has a predicted overshoot of {predicted.overshoot:.1%}, and a predicted settling time of"
        f" {predicted.settled_s:.2f} s. The measured overshoot is {wheel.after.overshoot:.1%}; with"
        f" the previous gains it was {wheel.before.overshoot:.1%}."
    ]
    if predicted.settled_s > goals.settled_s:
        remarks.append(
            f"The {wheel.name} wheel needs {predicted.settled_s:.2f} s to settle, more than the"
            f" {goals.settled_s:g} s that --settling asks for. A faster response is not possible"
            f" with this wheel and the controller's rate of {1 / wheel.loop.period_s:.0f} Hz."
        )
    if wheel.worse:
        remarks.append(
            f"The {wheel.name} wheel followed a step better with its previous gains (integrated"
            f" error {wheel.before.error_s:.2f} s) than with the new gains"
            f" ({wheel.after.error_s:.2f} s). So the new gains are not kept: allow more overshoot,"
            " or take more records. If the driver did not know the previous gains, restart the"
            " driver and the board to restore these gains."
        )
    return remarks


def draw(figure: "Figure", wheels: Sequence[WheelTuned]) -> None:
    """Draw the measured and the predicted steps, the wheels side by side."""
    axes: Any = figure.subplots(1, len(wheels), sharey=True, squeeze=False)
    for one, wheel in zip(axes[0], wheels, strict=True):
        _draw_wheel(one, wheel)
    axes[0, 0].set_ylabel("RPM")
    axes[0, 0].legend(fontsize=7, loc="lower right")


def _draw_wheel(axes: "Axes", wheel: WheelTuned) -> None:
    label: dict[str, str | None] = {"before": "measured, before", "after": "measured"}
    for name, colour, measured in (("before", "0.7", wheel.before), ("after", "C0", wheel.after)):
        for step in measured.steps:
            axes.plot(step.times_s, step.rpm, color=colour, linewidth=0.8, label=label[name])
            label[name] = None
    rpm = answer(wheel.plant, wheel.tuned.gains, wheel.loop, wheel.tuned.target_rpm, SECONDS)
    begins = int(np.argmax(np.cumsum(rpm) * STEP_S * wheel.loop.ticks_per_revolution / 60 >= 0.5))
    times_s = STEP_S * (np.arange(len(rpm)) - begins)
    axes.plot(times_s, rpm, color="C1", linewidth=1.2, label="predicted")
    axes.axhline(wheel.tuned.target_rpm, color="0.5", linewidth=0.5)
    gains = wheel.tuned.gains
    axes.set_title(
        f"{wheel.name}: Kp {float(gains.kp):.3f}, Tn {float(gains.tn_s):.3f} s,"
        f" Td {float(gains.td_s):.3f} s",
        fontsize=10,
    )
    axes.set_xlabel("s after the first tick")
    axes.set_xlim(0.0, SHOWN_S)
    axes.grid(alpha=0.3)
