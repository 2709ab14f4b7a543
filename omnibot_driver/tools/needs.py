# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the tools need beyond the driver, and the sentence for who has not got it."""

from importlib import import_module
from types import ModuleType


class ToolError(Exception):
    """A reason why a tool cannot go on, as a sentence with a remedy."""


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
