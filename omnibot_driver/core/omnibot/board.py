# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The OmniBot as a ``core.board.Board``: decodes its bytes, and encodes requests to it.

Source: the board's manual ver. 0.3. See ``translation`` for the data that the board
sends, and ``command_encoder`` for commands.
"""

import math
from typing import Final

from omnibot_driver.core.board import BoardFigures, Mode
from omnibot_driver.core.commands.set_point_stream import SetpointStream
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.imu.scale import ACCEL_COUNTS_PER_G, gravity_advice
from omnibot_driver.core.motion_monitor.monitor import Fault
from omnibot_driver.core.omnibot import frames
from omnibot_driver.core.omnibot.command_encoder import (
    EMERGENCY_STOP_PACKETS,
    STOP,
    STOP_PACKETS,
    CommandEncoder,
)
from omnibot_driver.core.omnibot.decoder import DecoderStatistics, FrameDecoder
from omnibot_driver.core.omnibot.modes import Happening
from omnibot_driver.core.omnibot.outbound import transmission
from omnibot_driver.core.omnibot.schedule import TICK_S, Schedule
from omnibot_driver.core.omnibot.settings import OmniBotSettings
from omnibot_driver.core.omnibot.single_imu import (
    Piece,
    is_begun,
    joined,
    take_pieces,
    take_single,
)
from omnibot_driver.core.omnibot.translation import Translation
from omnibot_driver.core.packets import NO_PACKETS, Packets, packed
from omnibot_driver.core.readings import Reading, SampleBoundary
from omnibot_driver.core.requests import Request
from omnibot_driver.core.traits import Traits

TRAITS: Final = Traits(
    imu_period_s=TICK_S,
    authorities=frozenset(Authority),
    requests=frozenset(Request),
    wheels=("A", "B", "C"),
    unheard_s=0.3,  # after this time, the board may be restarting
    silence_s=1.5,  # the board sends something at least once a second
    advice={
        Fault.WRONG_WAY: (
            "check `control_method`, `axis_signs`, `delta_frame` and the wiring of the wheels"
        ),
        Fault.WRONG_TURN: "check `control_method`, `axis_signs` and the wiring of the wheels",
        Fault.TOO_FAST: "check `control_method`, `linear_scale` and `delta_frame`",
        Fault.TURNS_TOO_FAST: (
            "check `control_method` and `angular_scale` (for wheel_cmd, `linear_scale`)"
        ),
        Fault.BEYOND_LIMITS: "check `control_method`, `linear_scale` and `angular_scale`",
        Fault.UNCOMMANDED: (
            "the driver sends Stop. If the robot is not being pushed, call ~/pause or switch the"
            " motors off by hand, and check the cable"
        ),
        Fault.BLOCKED: (
            "check motor power, whether the wheels are blocked, and that `control_method` matches"
            " the board's switch"
        ),
        Fault.HELD_BY_ESTOP: "the board itself may still hold the e-stop; call ~/reset",
    },
)

LAST_WORDS: Final = (STOP_PACKETS, EMERGENCY_STOP_PACKETS + STOP_PACKETS)


class OmniBot:
    """One OmniBot board on one line.

    ``settings`` may change at any time, except the delta period. A new baudrate, byte order or
    accelerometer range affects the decoder only from the next connection on.
    """

    traits = TRAITS
    clock = None
    wake_at = math.inf
    shows_standstill = True
    refusal = reset_refusal = start_refusal = own_motion = ""

    def __init__(self, settings: OmniBotSettings) -> None:
        self._schedule = Schedule(settings.delta_period_s)
        self._translation = Translation(settings)
        self._statistics = DecoderStatistics()
        self._encoder = CommandEncoder(settings)
        self.settings = settings
        self.connect()

    @property
    def settings(self) -> OmniBotSettings:
        """Settings that cannot be inferred from the board's data."""
        return self._settings

    @settings.setter
    def settings(self, settings: OmniBotSettings) -> None:
        self._settings = self._translation.settings = self._encoder.settings = settings
        byte_s = 10 / settings.baudrate
        self._nothing_begun = SampleBoundary(0, 0.0, (frames.IMU_LENGTH - 1) * byte_s)

    def connect(self) -> None:
        """Begin a new connection: forget everything except the settings and the counters."""
        self._decoder = FrameDecoder(
            self._settings.pose_byte_order,
            ACCEL_COUNTS_PER_G[self._settings.imu.accel_range_g],
            10 / self._settings.baudrate,
            self._schedule,
        )
        self._decoder.statistics = self._statistics
        self._pieces: list[Piece] = []
        """First bytes of an IMU frame that arrives in pieces, kept until the last piece arrives."""
        self._translation.connect()
        self._modes = self._translation.modes

    @property
    def mode(self) -> Mode:
        """The mode, as inferred from the board's data."""
        return self._modes.mode

    @property
    def edge(self) -> SampleBoundary | None:
        """The place in the stream of IMU frames at which the last read ended; None if unknown.

        If the last bytes of the read are the beginning of an IMU frame, the place is within this
        frame.
        """
        if self._pieces:
            begun: bytes | None = joined(self._pieces)
        elif self._decoder.at_rest:
            return self._nothing_begun
        else:
            begun = self._decoder.begun
        if begun is None:
            return None
        byte_s = 10 / self._settings.baudrate
        ahead, after = 0, len(begun)
        if begun[:2] == frames.IMU_HEADER:
            ahead, after = 1, len(begun) - frames.IMU_LENGTH
            if after < 0:
                return SampleBoundary(1, -after * byte_s, (-after - 1) * byte_s, cut=True)
        elif self._pieces or not self._decoder.fresh:
            return None
        return SampleBoundary(ahead, 0.0, (frames.IMU_LENGTH - 1 - after) * byte_s)

    @property
    def figures(self) -> BoardFigures:
        """Counters of faults over all connections, and the expected rates in Hz."""
        return BoardFigures(
            rates_hz=self._schedule.rates_hz,
            faults=self._statistics.faults,
            discarded_bytes=self._statistics.discarded_bytes,
            saturated=self._encoder.saturated,
        )

    def gravity_advice(self, gravity_mps2: float) -> str:
        """Return advice on the accelerometer's range; empty if the range seems to be right.

        ``gravity_mps2``: specific force at rest, in m/s².
        """
        return gravity_advice(gravity_mps2, self._settings.imu.accel_range_g)

    @property
    def advice(self) -> str | None:
        """Advice on a setting that the board's data contradicts; None if all seem right."""
        return self._translation.suspicion.advice

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """Return the readings that these bytes complete, in the order in which they were sent.

        ``now``: arrival time of the bytes in s.
        """
        if not data:
            return []
        pieces, line = self._pieces, (self._decoder, self._translation)
        single = take_pieces(pieces, data, now, *line) if pieces else take_single(data, now, *line)
        if single:
            pieces.clear()
            return [single]
        if len(data) < frames.IMU_LENGTH and is_begun(pieces, data, now, *line):
            pieces.append((data, now))
            return []
        before = self._decode_pieces() if pieces else []
        found = self._decoder.feed(data, now)
        return before + self._translation.readings(found, self._decoder.skipped, now)

    def _decode_pieces(self) -> list[Reading]:
        pieces, self._pieces = self._pieces, []
        readings: list[Reading] = []
        for data, now in pieces:
            found = self._decoder.feed(data, now)
            readings += self._translation.readings(found, self._decoder.skipped, now)
        return readings

    def flush(self, now: float) -> list[Reading]:
        """Return the readings in the bytes not yet decoded. Called after the line was closed."""
        readings = self._decode_pieces()
        found = self._decoder.flush(now)
        return readings + self._translation.readings(found, self._decoder.skipped, now)

    def discard(self) -> None:
        """Discard the held bytes.

        A frame in these bytes would get a wrong time, that of the next read.
        """
        self._decode_pieces()
        self._decoder.flush(self._decoder.last_arrival_s)

    def silence(self) -> None:
        """Forget the mode, because the board has been silent for too long."""
        self._translation.apply(Happening.HEARD_NOTHING)

    def stalled(self) -> None:
        """Do nothing after a stall of the driver, because this board drives nothing but the wheels.

        The driver itself stops the wheels after a stall.
        """

    def due(self, now: float) -> Packets:
        """Return no packets, because the board sends without polling."""
        return NO_PACKETS

    def elapse(self, now: float) -> list[Reading]:
        """Return no readings: this board's readings follow only from bytes, never from time."""
        return []

    def reset_odometry(self) -> None:
        """Do nothing: the board does not have a command that resets only its odometry."""

    def leave(self) -> None:
        """Do nothing: this board has no polls or subscriptions that the driver must end."""

    def actuator(self, proof: StopProof) -> SetpointStream:
        """Return the actuator of this board, which encodes each set-point and repeats its frame."""
        return SetpointStream(self._encoder, proof)

    def wake(self) -> Packets:
        """Return Stop. The packet begins with zero bytes, which wake the board."""
        return packed(STOP)

    def start_requested(self) -> None:
        """Do nothing: this board needs no preparation for a start that the user requests."""

    def start(self) -> Packets:
        """Return the letter S, which starts the board."""
        self._translation.apply(Happening.SENT_START)
        return packed(transmission(frames.FORCE_START))

    def pause(self) -> Packets:
        """Return Stop and the letter P.

        P would start a paused board. So this method raises RequestRefused if the board is paused or
        its mode is unknown.
        """
        self._translation.apply(Happening.SENT_PAUSE)
        return packed(transmission(frames.encode(frames.STOP), frames.TOGGLE_PAUSE))

    def force_pause(self) -> Packets:
        """Return Stop, S and P.

        S starts the board if it is paused, so P then pauses it in any case.
        """
        stop = frames.encode(frames.STOP)
        return packed(transmission(stop, frames.FORCE_START, frames.TOGGLE_PAUSE))

    def reset(self) -> Packets:
        """Return Stop and the letter R, which reboots the board."""
        self._translation.apply(Happening.SENT_RESET)
        return packed(transmission(frames.encode(frames.STOP), frames.RESET))

    def reset_given_up(self) -> None:
        """Do nothing when the driver gives up a reset, because ``due`` never repeats a reset."""

    def stop(self) -> Packets:
        """Return the manual's Stop, which works in both positions of the board's control switch."""
        return self._encoder.stop()

    def emergency_stop(self) -> Packets:
        """Return the packets of the emergency stop, as the board's manual defines it."""
        return self._encoder.emergency_stop()

    def switch_off(self) -> Packets:
        """Return no packets, because the board drives nothing but the wheels."""
        return NO_PACKETS

    def last_words(self) -> tuple[Packets, Packets]:
        """Return the guard's packets: Stop; with a latched e-stop, emergency stop and then Stop."""
        return LAST_WORDS
