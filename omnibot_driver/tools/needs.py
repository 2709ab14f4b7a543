# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the tools need beyond the driver, and the sentence for who has not got it."""

from importlib import import_module
from types import ModuleType


class ToolError(Exception):
    """What stands in a tool's way, as a sentence that says what to do next."""


def need(module: str) -> ModuleType:
    """This library of the extra ``tools``; raises ToolError where it is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        raise ToolError(
            f"this tool needs the Python library {error.name}: `pip install --user"
            f" --break-system-packages {error.name}` (in a virtual environment `pip install"
            f" {error.name}`)"
        ) from error
