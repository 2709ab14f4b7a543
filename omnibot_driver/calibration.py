# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The calibration file: measured values of this robot, in YAML, read at start.

A save replaces the file completely or not at all. The new file also has the names that the driver
does not use, but not the comments.
"""

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.parameters import Table, Value

RECORDED: Final = ("imu_rpy", "step")
"""Names that ``calibrate`` writes for people who read the file; the driver ignores them."""


def locate(file: str) -> Path:
    """Return the path of the file, with ``~`` resolved.

    Raises ParameterError for an unknown home folder.
    """
    try:
        return Path(file).expanduser()
    except RuntimeError as error:
        raise ParameterError(
            f"the calibration_file {file} cannot be found: its home folder does not exist; give"
            " the full path"
        ) from error


def load(path: Path, table: Table) -> dict[str, Value]:
    """Return the file's values of this board's calibrated parameters; empty without a file.

    Raises ParameterError, with a remedy, for a file that cannot be read or has a wrong value.
    """
    content = _read(path)
    try:
        return {
            name: table.by_name[name].check(value)
            for name, value in content.items()
            if name in table.calibrated
        }
    except ParameterError as error:
        raise _bad(path, f"is wrong ({error})") from error


def names(path: Path) -> list[str]:
    """Return all names in the file, whether the driver reads them or not; empty without a file."""
    return [str(name) for name in _read(path)]


def save(path: Path, values: Mapping[str, Any]) -> None:
    """Put these values into the file and keep its other values. Raises ParameterError or OSError.

    A concurrent reader finds either the old file or the new one, and so does the next start after a
    power failure. Comments in the file are lost; a symbolic link to it is kept.
    """
    import tempfile  # takes 1 MB, and few drivers ever save

    content = {**_read(path), **values}
    path = path.resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(prefix=path.name, dir=path.parent)
    try:
        with open(descriptor, "w", encoding="utf-8") as file:
            os.fchmod(descriptor, 0o644)
            yaml.safe_dump(content, file, sort_keys=False, default_flow_style=None)
            file.flush()
            os.fsync(descriptor)
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise


def _read(path: Path) -> dict[Any, Any]:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise _bad(path, f"cannot be read ({' '.join(str(error).split())})") from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise _bad(path, "has no `name: value` lines")
    return content


def _bad(path: Path, what: str) -> ParameterError:
    return ParameterError(
        f"the calibration_file {path} {what}: correct it, or remove it and calibrate again"
    )
