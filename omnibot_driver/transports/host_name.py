# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds out whether a silent host has left the address to which the driver sends.

A host may return with another address, for example from DHCP. So the driver looks up the name of a
silent host again.
"""

import contextlib
import ipaddress
import socket
import threading
import time
from typing import Final

SILENT_S: Final = 5.0
"""Time in s for which a host must be silent before its name is looked up again. It is also the
least time between two such lookups."""


class HostName:
    """The name of a host that may move to another address.

    ``in_use``: the address to which the driver sends. Lookups of the name can take long, so each
    runs in its own thread.
    """

    def __init__(self, name: str, in_use: str) -> None:
        self._name, self._in_use = name, in_use
        self._is_name = not _is_address(name)
        self._lookup: threading.Thread | None = None
        self.heard()

    def heard(self) -> None:
        """Record that the host has sent something, so its address is right."""
        self._heard_s = self._asked_s = time.monotonic()
        self._left = False

    def has_moved(self) -> bool:
        """Return whether the host is silent and its name no longer leads to the address in use.

        The name is looked up in the background, so only a later call returns the result.
        """
        now = time.monotonic()
        if not self._is_name or now < self._heard_s + SILENT_S:
            return False
        if now >= self._asked_s + SILENT_S and not self._looks_up:
            self._asked_s, self._left = now, False  # the host was heard since an older result
            self._lookup = threading.Thread(target=self._look_up, name="omnibot-name", daemon=True)
            with contextlib.suppress(RuntimeError):  # no thread can be started now
                self._lookup.start()
        return self._left

    @property
    def _looks_up(self) -> bool:
        return self._lookup is not None and self._lookup.is_alive()

    def _look_up(self) -> None:
        try:
            found = socket.getaddrinfo(self._name, None, type=socket.SOCK_DGRAM)
        except OSError:
            return  # the name service may be away too
        self._left = self._in_use not in {place[0] for *_, place in found}


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
