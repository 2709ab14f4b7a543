# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Files of a calibration: the driver's calibration file, and a picture."""

import os
from pathlib import Path
from typing import Any

import yaml

from omnibot_driver import calibration
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.parameters import Table
from omnibot_driver.tools.calibrate.result import Result
from omnibot_driver.tools.needs import ToolError

DEFAULT = "omnibot_calibration.yaml"
PICTURES = (".png", ".svg", ".pdf")


def output_file(given: str | None, drivers: str, table: Table) -> Path:
    """Return the path of the result file: ``given``, else ``drivers``, else a default name.

    ``given``: the user's choice. ``drivers``: the driver's calibration file. Raises ToolError if
    the file is not suitable.
    """
    try:
        path = calibration.locate(given or drivers or DEFAULT)
        calibration.load(path, table)
        content: Any = yaml.safe_load(path.read_text(encoding="utf-8")) if path.exists() else {}
    except ParameterError as error:
        raise ToolError(f"{error}; or name another file with --output") from error
    if any(isinstance(part, dict) and "ros__parameters" in part for part in _values(content)):
        raise ToolError(
            f"{path} is a file of ROS parameters: name another file with --output, and start the"
            " driver with calibration_file set to that file"
        )
    _require_writable(path)
    return path


def picture_file(given: str | None, subcommand: str) -> Path:
    """Return the path of the picture, by default ``calibrate_<subcommand>.png``.

    ``given``: a file, a folder, or None. Raises ToolError if the file cannot be written, or if its
    suffix is not that of a picture.
    """
    path = Path(given or ".").expanduser()
    if path.is_dir():
        path = path / f"calibrate_{subcommand}.png"
    if path.suffix.lower() not in PICTURES:
        raise ToolError(
            f"--plot {given} is neither a folder nor the name of a picture; the name must end in"
            f" {', '.join(PICTURES)}"
        )
    _require_writable(path)
    return path


def save(result: Result, output: Path, table: Table) -> None:
    """Save the result. On failure, leave the file unchanged and raise ToolError."""
    try:
        for name, value in result.parameters.items():
            table.by_name[name].check(value)
        if result.parameters or result.record:
            calibration.save(output, {**result.record, **result.parameters})
    except (OSError, ParameterError) as error:
        raise ToolError(f"the result cannot be written: {error}") from error


def draw(result: Result, output: Path, picture: Path) -> None:
    """Draw the picture of a result. Raises ToolError on failure.

    The message of the error also states whether the result is saved.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9, 6), layout="constrained")
        FigureCanvasAgg(figure)
        result.draw(figure)
        picture.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(picture, dpi=110)
    except Exception as error:  # whatever fails here, only the picture is lost
        saved = (
            f"the result is saved to {output}, but " if result.parameters or result.record else ""
        )
        raise ToolError(f"{saved}the picture {picture} is not drawn: {error}") from error


def _values(content: Any) -> list[Any]:
    return list(content.values()) if isinstance(content, dict) else []


def _require_writable(path: Path) -> None:
    folder = next(one for one in path.absolute().parents if one.exists())
    if not (folder.is_dir() and os.access(folder, os.W_OK)) or path.is_dir():
        raise ToolError(f"{path} cannot be written: choose another place")
