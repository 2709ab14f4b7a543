# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the cost of a frame. The cost is high if the frame contradicts the frames before it."""

import pytest

from omnibot_driver.core.omnibot.cost_model import NOTHING_KNOWN, Context, Expectation
from omnibot_driver.core.omnibot.frames import DeltaFrame, ImuFrame, PoseFrame

EXPECTATION = Expectation(16384.0)
IMU = ImuFrame((250, -130, -16380), (1, 2, 3))


def after_a_cycle(turns: list[int], seqs: list[int]) -> Context:
    """Return the decoder's context after a pose with a heading of 100 mrad, IMU frames and deltas.

    ``turns``: turns of the deltas, in 0.1 mrad. ``seqs``: counters of the deltas.
    """
    context = NOTHING_KNOWN
    for frame in (DeltaFrame(0, 0, 0, 9), PoseFrame(0.0, 0.0, 100.0, 1)):
        _, context = EXPECTATION.weigh(frame, context)
    for turn, seq in zip(turns, seqs, strict=True):
        for frame in (IMU, IMU, IMU, IMU, DeltaFrame(0, 0, turn, seq)):
            _, context = EXPECTATION.weigh(frame, context)
    return context


@pytest.mark.parametrize(
    ("theta_mrad", "contradicts"), [(105.2, False), (104.9, False), (107, True)]
)
def test_a_pose_is_held_against_the_turns_of_the_deltas_before_it(
    theta_mrad: float, contradicts: bool
) -> None:
    """A pose has a cost if its heading contradicts the previous pose and the deltas since then.

    Five deltas turn by 5 mrad in all; a difference by rounding has no cost.
    """
    context = after_a_cycle([10] * 5, [10, 11, 12, 13, 14])
    cost, _ = EXPECTATION.weigh(PoseFrame(0.0, 0.0, theta_mrad, 2), context)
    assert (cost > 0.0) is contradicts


def test_a_pose_after_a_lost_delta_contradicts_nothing() -> None:
    """After a lost delta, all headings of the next pose have the same cost.

    It is unknown how far the robot turned in the lost delta.
    """
    context = after_a_cycle([10] * 5, [10, 11, 13, 14, 15])
    near, _ = EXPECTATION.weigh(PoseFrame(0.0, 0.0, 105.0, 2), context)
    far, _ = EXPECTATION.weigh(PoseFrame(0.0, 0.0, 180.0, 2), context)
    assert near == far
