# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the frame schedule, which infers lost IMU frames from bytes that form no frame."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.omnibot.frame_schedule import FrameSchedule
from omnibot_driver.core.omnibot.frames import DeltaFrame, ImuFrame, PoseFrame

kinds = st.sampled_from([ImuFrame, DeltaFrame, PoseFrame])


def nominal(imus: int) -> FrameSchedule:
    """Return a schedule that has received all frames of nominal mode for 1 s, and more IMU frames.

    ``imus``: number of the IMU frames that follow this second.
    """
    rhythm = FrameSchedule()
    for _ in range(5):
        for _ in range(5):
            for kind in (ImuFrame, ImuFrame, ImuFrame, ImuFrame, DeltaFrame):
                assert rhythm.hear(kind, 0) == 0
        assert rhythm.hear(PoseFrame, 0) == 0
    for _ in range(imus):
        assert rhythm.hear(ImuFrame, 0) == 0
    return rhythm


@pytest.mark.parametrize(
    ("imus", "skipped", "lost"),
    [(1, 13, 1), (1, 12, 1), (1, 27, 2), (4, 8, 0), (4, 9 + 13, 1), (3, 13 + 8, 1), (1, 3, 0)],
)
def test_damaged_bytes_tell_how_many_imu_frames_they_were(
    imus: int, skipped: int, lost: int
) -> None:
    """The number of lost IMU frames is computed from the number of damaged bytes.

    A delta among these bytes is not counted as an IMU frame.
    """
    assert nominal(imus).hear(ImuFrame, skipped) == lost


def test_a_damaged_pose_is_not_an_imu_frame() -> None:
    """If a pose is due, 14 damaged bytes are not counted as a lost IMU frame.

    A pose has 15 bytes, and an IMU frame has 14.
    """
    rhythm = nominal(0)
    for _ in range(5):
        for kind in (ImuFrame, ImuFrame, ImuFrame, ImuFrame, DeltaFrame):
            rhythm.hear(kind, 0)
    assert rhythm.hear(ImuFrame, 14) == 0


def test_an_imu_frame_before_a_pose_is_told_with_the_frame_after_it() -> None:
    """An IMU frame and a delta are lost before a pose.

    The schedule returns 0 lost IMU frames for the pose, and 1 for the next frame.
    """
    rhythm = nominal(0)
    for _ in range(4):
        for kind in (ImuFrame, ImuFrame, ImuFrame, ImuFrame, DeltaFrame):
            rhythm.hear(kind, 0)
    for _ in range(3):
        rhythm.hear(ImuFrame, 0)
    assert rhythm.hear(PoseFrame, 14 + 9) == 0
    assert rhythm.hear(ImuFrame, 0) == 1


def test_imu_frames_alone_are_all_that_was_lost() -> None:
    """After 30 IMU frames in a row, only IMU frames can have been lost.

    So the schedule counts all damaged bytes as lost IMU frames.
    """
    rhythm = nominal(0)
    for _ in range(30):
        rhythm.hear(ImuFrame, 0)
    assert [rhythm.hear(ImuFrame, 14 * n - 1) for n in range(1, 9)] == list(range(1, 9))


@given(st.lists(st.tuples(kinds, st.integers(0, 500))))
def test_any_order_of_frames_is_borne(heard: list[tuple[type, int]]) -> None:
    """For any order of frames and damaged bytes, the schedule does not count too many lost frames.

    It counts at most one lost IMU frame for each seven damaged bytes.
    """
    rhythm = FrameSchedule()
    skipped = lost = 0
    for kind, count in heard:
        skipped += count
        lost += rhythm.hear(kind, count)
        assert 0 <= lost * 7 <= skipped
