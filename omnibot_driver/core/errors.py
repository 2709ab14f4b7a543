# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""All exceptions of the driver, in one class hierarchy.

An exception means that the driver or its user asked for something impossible. Invalid bytes are
counted instead.
"""


class OmniBotError(Exception):
    """Base class of all exceptions that this package raises on purpose."""


class FrameError(OmniBotError):
    """Bytes that are not one frame of the expected kind, or a value that does not fit its field."""


class RequestRefused(OmniBotError):
    """A request that is not possible now, e.g. because of the board's mode or another request."""


class CommandRefused(OmniBotError):
    """A motion command that the driver refuses or rejects, so it has no effect."""


class LinkError(OmniBotError):
    """A port that cannot be opened, read or written at the moment."""


class PortInUse(LinkError):
    """A port that cannot be opened, because another program has locked it."""


class ParameterError(OmniBotError):
    """A parameter that is unknown, of the wrong type or out of its range."""
