# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Diagnostics that only a Fejemis has, as texts under readable names."""

import math
from typing import Final

from omnibot_driver.core.board import BoardFigures
from omnibot_driver.core.fejemis.half import Half
from omnibot_driver.core.fejemis.ports import ROLES, Ports
from omnibot_driver.core.fejemis.translation import Translation
from omnibot_driver.core.fejemis.upkeep import Upkeep

SHOWN: Final = 3
"""The firmware reports commands that it does not know. The diagnostics show the latest ``SHOWN`` of
the driver's commands that were reported in this way.
"""
SUMS: Final = {True: "on", False: "off", None: "unknown"}


def figures(
    ports: Ports, upkeep: Upkeep, translation: Translation, source: float | None, trouble: str
) -> BoardFigures:
    """Return counters and other values for diagnostics. Counters continue over all connections.

    * ``source``: rcSource, the source of the commands that the drive board obeys.
    * ``trouble``: why the robot must not be driven, or empty.
    """
    return BoardFigures(
        rates_hz={"IMU": 100.0, "Odometry": 50.0},
        trouble=trouble,
        faults=sum(half.statistics.faults for half in ports.halves),
        discarded_bytes=sum(half.statistics.discarded_bytes for half in ports.halves),
        own=_own(ports, upkeep, translation, source),
    )


def _own(
    ports: Ports, upkeep: Upkeep, translation: Translation, source: float | None
) -> dict[str, str]:
    front, machine = translation.front, upkeep.machine
    own = {"Ports": "swapped" if ports.swapped else "as configured"}
    for role in ROLES:
        name = role.capitalize()
        half = ports.half(role)
        own |= {f"{name} {key}": text for key, text in _of_half(half).items()}
        own |= {f"{name} {key}": text for key, text in upkeep.polls[role].told.items()}
        for key, numbers in upkeep.configurations[role].told.items():
            own[f"{name} {key}"] = " ".join(f"{number:g}" for number in numbers)
    own["Front wheel (deg)"] = f"{math.degrees(front.angle_rad):.1f}"
    own["Front wheel sensor"] = front.fault or "works"
    return own | {
        "Source (rcSource)": "unknown" if source is None else f"{source:g}",
        "Brush": "on" if machine.brush else "off",
        "Lift (V)": f"{machine.volts:g}",
        "Angles refused": str(front.refused),
        "Poses refused": str(translation.odometry.refused),
    }


def _of_half(half: Half | None) -> dict[str, str]:
    if half is None or half.heartbeat is None:
        return {"board": "not heard"}
    beat = half.heartbeat
    own = {
        "board": f"id {beat.identity}, version {beat.version}",
        "line sums": SUMS[half.decoder.sums],
        "lines rejected": str(half.rejected),
    }
    if half.unknown_words:
        own["lines unknown"] = "; ".join(list(half.unknown_words)[-SHOWN:])
    return own
