# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The calibration file: measured values of one robot in YAML, which the driver reads at start."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.files import write_whole
from omnibot_driver.parameters import Table, Value

RECORDED: Final = ("imu_rpy", "step")
"""Names in the calibration file that the tool ``calibrate`` writes only for people who read the
file. The driver ignores them."""


def locate(file: str) -> Path:
    """Return the path of the file, with ``~`` replaced by the home folder.

    Raises ParameterError if the home folder does not exist.
    """
    try:
        return Path(file).expanduser()
    except RuntimeError as error:
        raise ParameterError(
            f"the calibration_file {file} cannot be found: the home folder in this path does not"
            " exist; give the full path"
        ) from error


def load(path: Path, table: Table) -> dict[str, Value]:
    """Return this board's calibrated parameters from the file; empty if the file does not exist.

    Raises ParameterError for an unreadable file or a wrong value; the message names a remedy.
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
    """Return all names in the file, also ignored ones; empty if the file does not exist.

    Raises ParameterError if the file cannot be read.
    """
    return [str(name) for name in _read(path)]


def save(path: Path, values: Mapping[str, Any]) -> None:
    """Write these values into the file, completely or not at all; keep its other values.

    Comments are lost; a symbolic link is kept. Raises ParameterError for an unreadable file, and
    OSError if writing fails.
    """
    content = {**_read(path), **values}
    write_whole(
        path.resolve(),
        lambda file: yaml.safe_dump(content, file, sort_keys=False, default_flow_style=None),
    )


def _read(path: Path) -> dict[Any, Any]:
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise ParameterError(
                f"the calibration_file {path} is not a file, but a device or a pipe: give another"
                " path"
            )
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise _bad(path, f"cannot be read ({reason})") from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise _bad(path, "has no `name: value` lines")
    return content


def _bad(path: Path, what: str) -> ParameterError:
    return ParameterError(
        f"the calibration_file {path} {what}: correct the file or the path, or remove the"
        " file and calibrate again"
    )
