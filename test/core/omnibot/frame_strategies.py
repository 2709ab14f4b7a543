# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Hypothesis strategies for frames, commands and byte streams of the OmniBot."""

import struct

from hypothesis import strategies as st

from omnibot_driver.core.omnibot import (
    CommandFrame,
    DeltaFrame,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    encode,
)
from omnibot_driver.core.omnibot.frames import Frame

# Words that make framing hard: look-alikes of headers, FF in either byte, and extreme values.
TREACHEROUS_WORDS = [-6, -5, -4, -1, 0, 255, -256, 0x5061, 32767, -32768]

words = st.one_of(st.sampled_from(TREACHEROUS_WORDS), st.integers(-32768, 32767))
counters = st.one_of(st.sampled_from([0, 255]), st.integers(0, 255))
floats32 = st.floats(width=32, allow_nan=False)
triples = st.tuples(words, words, words)

imu_frames = st.builds(ImuFrame, triples, triples)
delta_frames = st.builds(DeltaFrame, words, words, words, counters)
pose_frames = st.builds(PoseFrame, floats32, floats32, floats32, counters)
paused_frames = st.builds(PausedFrame, counters)
frames: st.SearchStrategy[Frame] = st.one_of(imu_frames, delta_frames, pose_frames, paused_frames)


def believable(frame: Frame) -> bool:
    """Return whether an undamaged board may send ``frame``.

    * Pose: no coordinate is above 1e7, in mm or mrad.
    * IMU frame: if the acceleration is below 0.5 g, none of its words is -6, which has the bytes of
      a header.
    """
    if isinstance(frame, PoseFrame):
        return max(abs(frame.x), abs(frame.y), abs(frame.theta)) <= 1e7
    if isinstance(frame, ImuFrame):
        return -6 not in frame.accel or sum(word * word for word in frame.accel) >= 8192**2
    return True


below_10_m_per_s = st.one_of(st.sampled_from(TREACHEROUS_WORDS[:7]), st.integers(-4000, 4000))
believable_frames = st.one_of(
    st.builds(ImuFrame, st.tuples(words, words, st.just(-16384)), triples),
    imu_frames.filter(believable),
    st.builds(DeltaFrame, below_10_m_per_s, below_10_m_per_s, below_10_m_per_s, counters),
    pose_frames.filter(believable),
    paused_frames,
)
"""Frames that an undamaged board may send. Damaged bytes can give other frames too."""

any_streams = st.lists(
    st.one_of(
        frames.map(encode),
        frames.map(lambda frame: encode(frame)[:-1]),
        st.binary(max_size=20),
        st.sampled_from([b"\xff", b"\xff\xfa", b"\xff\xfb", b"\xff\xfc", b"Paused: ", b"P"]),
    ),
    max_size=25,
).map(b"".join)
"""Streams of frames, broken frames, noise and beginnings of frames."""


@st.composite
def _calm_frames(draw: st.DrawFn) -> list[Frame]:
    sent: list[Frame] = []
    near = st.integers(-30, 30)
    seq, pose_seq = draw(counters), draw(counters)
    for kind in draw(st.lists(st.sampled_from("iidp"), max_size=30)):
        if kind == "i":
            accel, gyro = draw(st.tuples(near, near, near)), draw(st.tuples(near, near, near))
            sent.append(ImuFrame((accel[0] + 120, accel[1] - 80, accel[2] - 16384), gyro))
        elif kind == "d":
            seq = (seq + 1) % 256
            sent.append(DeltaFrame(*draw(st.tuples(*[st.integers(-400, 400)] * 3)), seq))
        else:
            pose_seq = (pose_seq + 1) % 256
            place = draw(st.tuples(*[st.integers(-100, 100).map(float)] * 3))
            sent.append(PoseFrame(*place, pose_seq))
    return sent


calm_frames = _calm_frames()
"""Frames of all kinds, in any order.

The values of a frame are close to those of the previous frame of the same kind. The counters are
consecutive.
"""

commands = st.builds(CommandFrame, st.integers(0, 255), triples)
byte_orders = st.sampled_from(["big", "little"])


def float32(value: float) -> float:
    """Return ``value``, rounded to the precision of a 32-bit float."""
    (rounded,) = struct.unpack(">f", struct.pack(">f", value))
    assert isinstance(rounded, float)
    return rounded
