# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The exceptions of the driver, all of them, in one tree.

Bytes that came from a board never raise; they are counted. These are raised for what *we* or our
users ask for and cannot have. Each message says what is wrong and what to do next.
"""


class OmniBotError(Exception):
    """Base class of all exceptions that this package raises on purpose."""


class FrameError(OmniBotError):
    """Bytes that are not the one whole frame they were said to be, or values no frame can hold."""


class RequestRefused(OmniBotError):
    """A request that the board's present mode, or another request under way, does not allow."""


class CommandRefused(OmniBotError):
    """A motion command that will not be carried out. It has no effect."""


class LinkError(OmniBotError):
    """The port cannot be opened, read or written just now."""


class ParameterError(OmniBotError):
    """A parameter that is unknown, of the wrong type or out of its range."""
