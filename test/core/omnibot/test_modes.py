# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the mode table: how S, P, R and received data change the mode."""

from itertools import product

import pytest
from frame_strategies import frames, imu_frames
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.board import Mode
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.omnibot import DeltaFrame, ImuFrame, PausedFrame, PoseFrame
from omnibot_driver.core.omnibot.frames import Frame
from omnibot_driver.core.omnibot.modes import TRANSITIONS, Happening, ModeTracker

IMU = ImuFrame((0, 0, -16384), (0, 0, 0))
DELTA = DeltaFrame(0, 0, 0, 0)
POSE = PoseFrame(0.0, 0.0, 0.0, 0)
PAUSED = PausedFrame(0)

HEARD = [happening for happening in Happening if happening.name.startswith("HEARD")]


def tracker(mode: Mode) -> ModeTracker:
    """Return a mode tracker that has received frames which show ``mode``."""
    made = ModeTracker()
    heard = {Mode.UNKNOWN: [], Mode.PAUSED: [PAUSED], Mode.NOMINAL: [DELTA]}
    for frame in heard.get(mode, [IMU] * 25):
        made.hear(frame)
    assert made.mode is mode
    return made


def test_the_public_names_are_those_of_the_interface() -> None:
    """The names of the modes are the values that ~/state publishes."""
    assert {mode.value for mode in Mode} == {"connecting", "paused", "nominal", "imu_only"}
    assert {mode for mode in Mode if mode.running} == {Mode.NOMINAL, Mode.IMU_ONLY}


def test_nothing_is_believed_before_anything_is_heard() -> None:
    """On a new line, the mode is unknown until data arrives."""
    assert ModeTracker().mode is Mode.UNKNOWN


@pytest.mark.parametrize(("happening", "mode"), list(product(HEARD, Mode)))
def test_the_table_is_total_over_what_is_heard(happening: Happening, mode: Mode) -> None:
    """For any data from the board and any present mode, the mode table names the next mode.

    No entry may be missing, because any data may arrive in any mode.
    """
    made = tracker(mode)
    made.apply(happening)
    assert made.mode is TRANSITIONS[happening][mode]


def test_only_p_is_ever_refused() -> None:
    """P is refused in some modes. S and R are allowed in every mode."""
    missing = {
        happening
        for happening, mode in product(Happening, Mode)
        if mode not in TRANSITIONS[happening]
    }
    assert missing == {Happening.SENT_PAUSE}


@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize(
    ("frame", "heard"),
    [(PAUSED, Mode.PAUSED), (DELTA, Mode.NOMINAL), (POSE, Mode.NOMINAL)],
    ids=["text", "delta", "pose"],
)
def test_one_frame_that_tells_the_mode_is_enough(mode: Mode, frame: Frame, heard: Mode) -> None:
    """A single «Paused» text, delta or pose determines the mode, whatever the mode was before."""
    made = tracker(mode)
    made.hear(frame)
    assert made.mode is heard


@pytest.mark.parametrize("mode", Mode)
def test_the_mode_is_imu_only_after_25_imu_frames_alone(mode: Mode) -> None:
    """25 IMU frames in a row show IMU-only mode. 24 do not.

    In nominal mode, a delta follows every fourth IMU frame. If five deltas are lost, 24 IMU frames
    come in a row.
    """
    made = tracker(mode)
    if mode is Mode.IMU_ONLY:
        made.hear(DELTA)
        mode = Mode.NOMINAL
    for _ in range(24):
        made.hear(IMU)
        assert made.mode is mode
    made.hear(IMU)
    assert made.mode is Mode.IMU_ONLY


def test_the_rhythm_of_a_nominal_board_is_never_imu_only() -> None:
    """Five of six deltas are lost, so 24 IMU frames come in a row. The mode stays nominal."""
    made = ModeTracker()
    for tick in range(1, 400):
        made.hear(IMU)
        if tick % 4 == 0 and tick % 24 == 0:
            made.hear(DELTA)
        assert made.mode is (Mode.NOMINAL if tick >= 24 else Mode.UNKNOWN)


@pytest.mark.parametrize("mode", Mode)
def test_r_makes_the_mode_unknown(mode: Mode) -> None:
    """After R, the mode is unknown until data arrives."""
    made = tracker(mode)
    made.apply(Happening.SENT_RESET)
    assert made.mode is Mode.UNKNOWN


def test_imu_frames_from_before_r_do_not_count_after_it() -> None:
    """24 IMU frames come before R and one after it.

    The mode is unknown, because the 24 frames no longer count.
    """
    made = tracker(Mode.NOMINAL)
    for _ in range(24):
        made.hear(IMU)
    made.apply(Happening.SENT_RESET)
    made.hear(IMU)
    assert made.mode is Mode.UNKNOWN


@pytest.mark.parametrize("mode", Mode)
def test_a_letter_alone_proves_nothing(mode: Mode) -> None:
    """S and P may be lost.

    So sending one of them does not change the mode. Only received data does.
    """
    made = tracker(mode)
    made.apply(Happening.SENT_START)
    assert made.mode is mode
    if mode.running:
        made.apply(Happening.SENT_PAUSE)
        assert made.mode is mode


@pytest.mark.parametrize("mode", [Mode.UNKNOWN, Mode.PAUSED])
def test_p_is_refused_where_the_board_is_not_known_to_run(mode: Mode) -> None:
    """P is a toggle and would start a paused board.

    P is refused if the board is not known to run.
    """
    made = tracker(mode)
    with pytest.raises(RequestRefused, match=mode.value):
        made.apply(Happening.SENT_PAUSE)
    assert made.mode is mode


@pytest.mark.slow
@given(st.lists(st.one_of(st.sampled_from(Happening), frames, imu_frames), max_size=80))
def test_an_illegal_request_raises_and_changes_nothing(
    happenings: list[Happening | Frame],
) -> None:
    """A mode tracker refuses a request.

    Then it continues exactly like a tracker that never got the request.
    """
    asked, spared = ModeTracker(), ModeTracker()
    for happening in happenings:
        if not isinstance(happening, Happening):
            asked.hear(happening)
            spared.hear(happening)
        elif happening is Happening.SENT_PAUSE and not asked.mode.running:
            with pytest.raises(RequestRefused):
                asked.apply(happening)
        else:
            asked.apply(happening)
            spared.apply(happening)
        assert asked.mode is spared.mode
    for _ in range(25):
        asked.hear(IMU)
        spared.hear(IMU)
        assert asked.mode is spared.mode
