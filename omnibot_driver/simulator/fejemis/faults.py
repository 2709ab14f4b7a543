# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The faults that can occur in each of the two Teensys, by name.

This module knows what each fault does. It must not know when a fault occurs.
"""

from collections.abc import Callable
from typing import Any

from omnibot_driver.simulator.fejemis.drive import DriveTeensy
from omnibot_driver.simulator.fejemis.front import HEALTHY, FrontTeensy

Half = DriveTeensy | FrontTeensy


def _set(**values: Any) -> Callable[[Half], None]:
    def befall(half: Half) -> None:
        for name, value in values.items():
            setattr(half, name, value)

    return befall


def _diagnosis(bits: int) -> Callable[[Half], None]:
    return _set(diagnosis=HEALTHY ^ bits)


FAULTS: dict[str, Callable[[Half], None]] = {
    "silent": _set(silent=True),
    "hung": _set(hung=True),
    "unplugged": _set(unplugged=True),
    "well": _set(silent=False, hung=False, unplugged=False),
    "restart": lambda half: half.reboot(),
    "sums-begin": _set(sums=True),
    "sums-end": _set(sums=False),
}
"""Faults that either Teensy can have, by name."""

SENSOR_FAULTS: dict[str, Callable[[Half], None]] = {
    "sensor-well": _set(diagnosis=HEALTHY, error_flags=0, frozen=False, absent=False),
    "sensor-frozen": _set(frozen=True),
    "sensor-absent": _set(absent=True),
    "sensor-error": _set(error_flags=0x1),
    "hall-broken": _diagnosis(1 << 10),
    "agc-unsettled": _diagnosis(1 << 9),
    "offset-unfinished": _diagnosis(1 << 8),
    "sine-unfinished": _diagnosis(1 << 7),
    "cosine-unfinished": _diagnosis(1 << 6),
    "magnet-weak": _diagnosis(1 << 5),
    "agc-high": _diagnosis(1 << 4),
    "agc-low": _diagnosis(1 << 3),
    "cordic-overflow": _diagnosis(1 << 2),
    "loops-unfinished": _diagnosis(1 << 1),
    "supply-5v": _diagnosis(1 << 0),
}
"""Faults of the angle sensor, by name. Only the front Teensy can have them."""


def allowed(half: str) -> dict[str, Callable[[Half], None]]:
    """Return the faults that ``drive`` or ``front`` can have, by name."""
    return FAULTS | SENSOR_FAULTS if half == "front" else FAULTS
