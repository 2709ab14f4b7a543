# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Makes both boards send data, configures them, and carries out requests other than motion.

The module combines subscriptions, polls, configuration, jobs, brush, lift and lights.
"""

from typing import Final

from omnibot_driver.core.fejemis.configuration import Configuration
from omnibot_driver.core.fejemis.half import Half, Role
from omnibot_driver.core.fejemis.jobs import Jobs
from omnibot_driver.core.fejemis.machine import Machine
from omnibot_driver.core.fejemis.messages import Message
from omnibot_driver.core.fejemis.polls import Polls
from omnibot_driver.core.fejemis.ports import ROLES, Ports
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written
from omnibot_driver.core.fejemis.steering import Geometry
from omnibot_driver.core.packets import Packets
from omnibot_driver.core.requests import LEAVING

GEOMETRIES_DIFFER_M: Final = 0.002


class Upkeep:
    """The regular work for both boards, such as subscriptions and configuration.

    ``machine``: brush, lift and lights of the front board.

    ``configurations``, ``polls``: one entry for each board, by its role.
    """

    def __init__(self, ports: Ports, settings: FejemisSettings) -> None:
        self._ports, self._settings = ports, settings
        self.machine, self.jobs = Machine(), Jobs()
        self._leaving = False
        self.configurations = {role: Configuration(role, settings.written) for role in ROLES}
        self.polls = {role: Polls(role) for role in ROLES}

    def configure(self, settings: FejemisSettings) -> None:
        """Use new settings. They are written to the boards while the robot stands still."""
        self._settings = settings
        for configuration in self.configurations.values():
            configuration.configure(settings.written)

    def begin(self) -> None:
        """Begin anew after a connection: switch off brush and lift, and configure both boards."""
        self.machine.off()
        self.jobs.begin()
        for role in ROLES:
            self._begin(role)

    def leave(self) -> None:
        """Prepare the shutdown: end the running job, and switch brush and lift off.

        From now on, send only the lines for brush, lift and lights.
        """
        self._leaving = True
        self.machine.off()
        self.jobs.cancel(LEAVING)

    def restarted(self, role: Role) -> None:
        """Configure the board ``role`` again, because it has restarted.

        Brush and lift are switched off. The restart has interrupted the running job, so this job
        ends as failed.
        """
        self._begin(role)
        self.machine.begin()
        self.jobs.restarted(role)

    def _begin(self, role: Role) -> None:
        self.configurations[role].begin()
        self.polls[role].begin()

    @property
    def geometry(self) -> Geometry:
        """Track and wheelbase in m, as the drive board uses them.

        They come from the settings until the board has reported its own values.
        """
        nominal = Geometry(self._settings.track_m, self._settings.wheelbase_m)
        return self.configurations["drive"].geometry or nominal

    def hear(self, role: Role, message: Message, now: float) -> None:
        """Pass a message of the board ``role`` to jobs, configuration and polls."""
        configurations = self.configurations
        self.jobs.hear(role, message, now)
        configurations[role].hear(message)
        self.polls[role].hear(message)
        configurations["front"].turned = configurations["drive"].turned
        if self.jobs.reload:
            self.jobs.reload = False
            for configuration in configurations.values():
                configuration.begin()

    @property
    def wake_at(self) -> float:
        """Time in s at which to call ``due`` next."""
        times = [self.jobs.wake_at, self.machine.wake_at]
        if self._leaving:
            return min(times)
        for half in self._ports.halves:
            times.append(half.wake_at)
            if half.role is not None and half.ready:
                times += (self.configurations[half.role].wake_at, self.polls[half.role].wake_at)
        return min(times)

    def due(self, now: float, *, stands: bool) -> Packets:
        """Return the packets to send now; ``stands``: whether no motion is commanded."""
        packets = self._ports.ending("front", *self.machine.due(now))
        for role, texts in self.jobs.due(now).items():
            packets += self._ports.line(role, *texts)
        if self._leaving:
            return packets
        for channel, half in enumerate(self._ports.halves):
            packets += self._ports.at(channel, *self._of_half(half, now, stands=stands))
        return packets

    def _of_half(self, half: Half, now: float, *, stands: bool) -> list[bytes]:
        texts = half.due(now)
        if half.role is not None and half.ready:
            texts += self.configurations[half.role].due(now, stands=stands)
            texts += self.polls[half.role].due(now, sums=half.sums, unknown=half.unknown_words)
        return texts

    @property
    def pending(self) -> str:
        """Why the robot must not be driven now; empty if it may be driven.

        It must not be driven while the configuration of a board is being written.
        """
        for configuration in self.configurations.values():
            if configuration.pending:
                return (
                    f"the configuration of the {configuration.role} board is being written; this"
                    " takes at most 3 s"
                )
        return ""

    @property
    def advice(self) -> str | None:
        """Advice on what the user should set or update; None if there is nothing to advise."""
        for configuration in self.configurations.values():
            if configuration.failed:
                names = ", ".join(setting.value for setting in configuration.failed)
                return (
                    f"the {configuration.role} board does not keep the values written with"
                    f" {names}; check these values and the board's firmware"
                )
        for channel, half in enumerate(self._ports.halves):
            if half.decoder.contradicted:
                without = "without" if self._settings.line_sums == "on" else "with"
                return (
                    f"the parameter `line_sums` is {self._settings.line_sums}, but the lines of"
                    f" the {self._ports.role(channel)} board come {without} checksums: set"
                    " `line_sums` to auto"
                )
            if unknown := half.unknown_streams:
                return (
                    f"the firmware of the {half.role} board does not know {', '.join(unknown)}"
                    " and cannot send this data; update the firmware"
                )
        one, other = (self.configurations[role].geometry for role in ROLES)
        told = Written.STEERING not in self._settings.written  # else `failed` reports it
        if told and one and other and _differ(one, other):
            return (
                "the boards are configured to different steering geometries (confs). Drive board:"
                f" track {one.track_m:g} m, steering distance {one.wheelbase_m:g} m. Front board:"
                f" track {other.track_m:g} m, steering distance {other.wheelbase_m:g} m. Set the"
                " parameters `track` and `steering_distance`, which configure both boards"
            )
        return None


def _differ(one: Geometry, other: Geometry) -> bool:
    return (
        abs(one.track_m - other.track_m) > GEOMETRIES_DIFFER_M
        or abs(one.wheelbase_m - other.wheelbase_m) > GEOMETRIES_DIFFER_M
    )
