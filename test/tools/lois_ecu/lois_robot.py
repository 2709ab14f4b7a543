# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated robot with a LOIS ECU, which tests of ``calibrate`` use instead of a driver.

The robot runs in simulated time.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from random import Random
from typing import Any

from any_board import AnyBench, LoisRobot

from omnibot_driver.boards import lois_ecu
from omnibot_driver.boards.lois_ecu_records import save
from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.events import Extra
from omnibot_driver.core.lois_ecu import RecordKind
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.readings import RecordReading
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.simulator.lois_ecu import (
    QUIRKS,
    Firmware,
    LoisSettings,
    MotorSettings,
    SimulatedLois,
)

SETTINGS = SessionSettings(
    limits=SpeedLimits(),
    commands=CommandSettings(timeout_s=1.0),
    odometry=OdometrySettings(),
    motion_monitor=False,
)


def random_motors(seed: int, *, unequal: float = 0.05) -> tuple[MotorSettings, MotorSettings]:
    """Return two random motors of second order, with dead time and backlash.

    ``unequal``: how much the constants of the two motors vary, as a relative standard deviation.
    """
    random = Random(f"plant {seed}")
    slow_s = random.uniform(0.15, 0.5)
    fast_s = slow_s * random.uniform(0.25, 0.6)
    gain, dead_s = random.uniform(0.55, 0.8), random.uniform(0.0, 0.04)
    zone, gap = random.uniform(3.0, 9.0), random.uniform(0.0, 0.01)
    return tuple(  # type: ignore[return-value]
        MotorSettings(
            rpm_per_percent=gain * random.gauss(1.0, unequal),
            dead_zone_percent=zone,
            time_constant_s=slow_s * random.gauss(1.0, unequal),
            second_time_constant_s=fast_s * random.gauss(1.0, unequal),
            dead_time_s=dead_s,
            backlash_turns=gap,
        )
        for _ in range(2)
    )


class SimulatedRobot:
    """A replacement for the ``Robot`` of a calibration, with a simulated LOIS ECU."""

    def __init__(
        self,
        folder: Path,
        motors: tuple[MotorSettings, MotorSettings],
        *,
        firmware: Firmware = "firmware",
        mark_noise: float = 0.1,
        seed: int = 0,
    ) -> None:
        self.folder, self._count = folder, 0
        self.parameters: dict[str, Any] = lois_ecu.PARAMETERS.check_all({})
        self._robot = LoisRobot(firmware)
        self._robot.board = SimulatedLois(
            LoisSettings(
                quirks=QUIRKS[firmware],
                seed=seed,
                running=True,
                motors=motors,
                mark_noise=mark_noise,
                load_percent=0.5,
            )
        )
        self._board = LoisEcuBoard(lois_ecu.settings(self.parameters))
        self.bench = AnyBench(self._board, self._robot)
        self.bench.session.configure(SETTINGS, self.bench.now)
        self.bench.open()
        self.bench.run_until(lambda: self.bench.session.state == "nominal")
        self.bench.run(1.5)

    @property
    def board(self) -> SimulatedLois:
        return self._robot.board

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        self.parameters = lois_ecu.PARAMETERS.check_all({**self.parameters, **values})
        settings = lois_ecu.settings(self.parameters)
        self.bench.session.configure(SETTINGS, self.bench.now, board=settings)
        self.bench.settle()

    def restore_parameters(self, values: Mapping[str, Any]) -> None:
        self.set_parameters(values)

    def diagnosed(self, key: str) -> str:
        assert key == "Odometry rate (Hz)"
        self.bench.run_until(lambda: bool(self._board.figures.rates_hz))
        return f"nan of {self._board.figures.rates_hz['Odometry']:g}"

    def rest(self, seconds: float) -> None:
        self.bench.run(seconds)

    def record(self, service: str, topic: str, command: Sequence[float]) -> Path:
        assert service == "record_rpm"
        bench, board = self.bench, self._board
        bench.events.clear()
        board.record(RecordKind.RPM, self.parameters["record_samples"])
        bench.settle()
        bench.run(0.6)
        if topic == "duty_cmd":
            settings = board.settings
            rates = [one / (settings.duty_scale * settings.wheel_radius_m) for one in command]
        else:
            rates = list(command)
        for _ in range(2400):
            seen = len(bench.events)
            bench.session.command_wheels(rates, bench.now)
            bench.settle()
            bench.run(0.05)
            if found := self._records(seen):
                break
        bench.session.command_wheels([0.0, 0.0], bench.now)
        bench.run_until(lambda: self.board.standing)
        bench.run(2.5)
        (reading,) = found
        self._count += 1
        path = self.folder / f"{self._count}.csv"
        assert save(reading, path)
        return path

    def _records(self, since: int) -> list[RecordReading]:
        return [
            event.value
            for event in self.bench.events[since:]
            if isinstance(event, Extra) and isinstance(event.value, RecordReading)
        ]
