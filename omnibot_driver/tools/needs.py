# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Import libraries that only the tools need, or say how to install them."""

from importlib import import_module
from types import ModuleType


class ToolError(Exception):
    """An error that ends a tool; its message is a sentence with a remedy."""


def need(module: str) -> ModuleType:
    """Import and return a library that only the tools need. Raises ToolError if it is missing."""
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
