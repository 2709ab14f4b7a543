# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Imports a library that only the tools need, or says how to install it."""

from importlib import import_module
from types import ModuleType


class ToolError(Exception):
    """An error that ends a tool. Its message is a sentence that says what to do."""


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
