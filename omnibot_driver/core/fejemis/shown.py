# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What only this board has to show in diagnostics, by names for people. Knows no bytes."""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.fejemis.configuration import Configuration
from omnibot_driver.core.fejemis.front_wheel import FrontWheel
from omnibot_driver.core.fejemis.half import Half, Role
from omnibot_driver.core.fejemis.polls import Polls
from omnibot_driver.core.fejemis.ports import ROLES, Ports

SHOWN: Final = 3
"""How many of the latest lines that a board did not know are shown."""
SUMS: Final = {True: "on", False: "off", None: "unknown"}


def own_figures(
    ports: Ports,
    polls: Mapping[Role, Polls],
    configurations: Mapping[Role, Configuration],
    front: FrontWheel,
) -> dict[str, str]:
    """Version, identity and what was read of each board."""
    own = {"Ports": "swapped" if ports.swapped else "as configured"}
    for role in ROLES:
        name = role.capitalize()
        half = ports.half(role)
        own |= {f"{name} {key}": text for key, text in _of_half(half).items()}
        own |= {f"{name} {key}": text for key, text in polls[role].told.items()}
        for key, numbers in configurations[role].told.items():
            own[f"{name} {key}"] = " ".join(f"{number:g}" for number in numbers)
    own["Front wheel (deg)"] = f"{math.degrees(front.angle_rad):.1f}"
    own["Front wheel sensor"] = front.fault or "works"
    return own


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
