# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Rejects names of ports that can never be opened, and explains why a port cannot be opened now.

Every text says what to do. This module knows pyserial's URLs and errors, and opens no port.
"""

import contextlib
import errno
import io
import os
import re
import stat
import termios
from pathlib import Path

import serial

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.transports import NOT_POLLABLE


def check_address(url: str, parameter: str = "port", *, pollable: bool = False) -> None:
    """Raise ParameterError if this port can never be opened; the check itself opens no port.

    A missing device or an unknown host is accepted: it may appear later. ``pollable``: whether the
    port must have a file descriptor.
    """
    try:
        port = serial.serial_for_url(url, do_not_open=True)
        if not isinstance(port, serial.Serial):  # the other classes read the URL in ``open``
            host, *_ = port.from_url(url) or ("",)
            (host or "").encode("idna")
        elif "://" not in url and not url.startswith("/"):
            raise ParameterError(_misread(url, parameter))
        with contextlib.suppress(OSError):
            if not stat.S_ISCHR(os.stat(url).st_mode):
                raise ParameterError(_no_terminal(url, parameter))
    except ParameterError:
        raise
    except Exception as error:  # pyserial's URL handlers can raise any exception
        if _is_misread(error):
            raise ParameterError(_misread(url, parameter)) from error
        return
    if pollable and type(port).fileno is io.RawIOBase.fileno:
        raise ParameterError(f"{parameter} '{url}' is not valid: {NOT_POLLABLE}")


def explain(url: str, parameter: str, error: Exception) -> str:
    """Return a sentence that says why this port cannot be opened, and what to do."""
    code = error.errno if isinstance(error, OSError) else None
    if isinstance(error, ValueError) and "baud rate" in str(error):
        return f"{url} does not accept the baud rate: {error}; check the parameter `baudrate`"
    if "remote rejected" in str(error):  # the words of pyserial for rfc2217://
        return (
            f"cannot open {url}: the server does not accept a setting ({error}); check the"
            " parameter `baudrate` and the server"
        )
    if _is_misread(error):
        return _misread(url, parameter)
    if _is_gone(error):
        return (
            f"cannot open {url}: the device does not respond; unplug the board and plug it in"
            f" again, or check the parameter `{parameter}`"
        )
    no_terminal = isinstance(error, termios.error) or isinstance(error.__context__, termios.error)
    if no_terminal or code == errno.EISDIR:
        return _no_terminal(url, parameter)
    if code == errno.ENOENT:
        return (
            f"{url} does not exist; plug the board in, find its port with `ls /dev/serial/by-id/`"
            f" and set the parameter `{parameter}`; without a robot try port:=sim://"
        )
    if code in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {url}: join the group dialout with"
            " `sudo usermod -aG dialout $USER` and log in again"
        )
    if is_in_use(error):
        return (
            f"{url} is in use by another program{_owner(url)}, perhaps a second driver; end it"
            f" first (`fuser {url}` names it; the guard of a killed driver ends by itself)"
        )
    # pyserial's text for an error of the operating system would name the port twice.
    source = error.__context__ if isinstance(error.__context__, OSError) else error
    reason = getattr(source, "strerror", None) or source
    if isinstance(source, ConnectionRefusedError):
        return (
            f"cannot open {url}: {reason}: check that the server is running and that this is"
            " its port"
        )
    return f"cannot open {url}: {reason}; check the parameter `{parameter}`"


def is_in_use(error: Exception) -> bool:
    """Return whether the error means that another program has locked the port."""
    return isinstance(error, OSError) and error.errno in (errno.EAGAIN, errno.EBUSY)


def _is_gone(error: Exception) -> bool:
    """Return whether the error means that no device is behind the terminal.

    Either the device was unplugged, or this terminal never had one.
    """
    return any(
        isinstance(each, termios.error) and each.args[:1] in ((errno.EIO,), (errno.ENODEV,))
        for each in (error, error.__context__)
    )


def _is_misread(error: Exception) -> bool:
    """Return whether the error means that pyserial does not understand the URL."""
    # pyserial replaces some errors by its own, without their number; the context has the original.
    misread = TypeError | ValueError | LookupError | re.error
    return isinstance(error, misread) or isinstance(error.__context__, misread)


def _misread(url: str, parameter: str) -> str:
    simulated = ", or sim:// for a simulated board" if parameter == "port" else ""
    return (
        f"{parameter} '{url}' is not valid: give the whole path of a device, like /dev/ttyUSB0,"
        f" or a pyserial URL like socket://host:port{simulated}; check the parameter `board` too"
    )


def _no_terminal(url: str, parameter: str) -> str:
    return (
        f"{url} is not a serial port; find the port with `ls /dev/serial/by-id/` and set"
        f" `{parameter}`"
    )


def _owner(path: str) -> str:
    """Return number and name of the process that has locked the file ``path``, in brackets.

    Empty if no process has locked the file, or if its name cannot be read.
    """
    with contextlib.suppress(OSError, ValueError):
        status = os.stat(path)
        device = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}"
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            _, kind, _, _, pid, file, *_ = line.replace("-> ", "").split()
            if kind == "FLOCK" and file == f"{device}:{status.st_ino}":
                # The kernel cuts a name after 15 bytes, which may be within a character.
                name = Path(f"/proc/{pid}/comm").read_text("utf-8", errors="replace").strip()
                return f" (process {pid}, {name})"
    return ""
