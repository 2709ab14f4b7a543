# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``Inbound.process``: what its result False means, and which data answers a request."""

from contextlib import suppress

import pytest

from omnibot_driver import boards, parameters
from omnibot_driver.boards import omnibot
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.omnibot import OmniBot
from omnibot_driver.core.packets import joined
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.core.session import Session
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

TICK_S = 0.01


def opened(*, run: bool = True) -> Session:
    values = boards.check_all({})
    board = omnibot.settings(values)
    settings = parameters.session_settings(values, omnibot.kinematics(values))
    session = Session(OmniBot(board), settings, run=run)
    session.opened(0.0)
    return session


REQUESTS = {400: Request.START, 700: Request.PAUSE, 1000: Request.START, 1300: Request.RESET}


@pytest.mark.slow
@pytest.mark.parametrize("run", [True, False])
@pytest.mark.parametrize("drives", [False, True])
def test_where_nothing_is_left_there_is_nothing_to_write_or_to_tell(
    drives: bool, run: bool
) -> None:
    """``process`` returns False if a read leaves the session nothing to write or to report.

    This is the result of most reads that contain only IMU readings.
    """
    session, board = opened(run=run), SimulatedBoard(BoardSettings(seed=2))
    nothing_left, told = 0, 0
    for tick in range(2000):
        now = tick * TICK_S
        data = board.step()
        if tick in REQUESTS:
            session.request(REQUESTS[tick], "asked", now)
        if drives and tick % 5 == 0:
            with suppress(CommandRefused):
                session.command_twist(BodyTwist(0.1, 0.0, 0.0), now)
        board.receive(joined(session.take_output(now)))
        told += len(session.take_events())
        if data:
            session.inbound.hear(data, now)
            if not session.inbound.process(now):
                nothing_left += 1
                assert session.take_output(now) == ()
                assert session.take_events() == []
        if session.wake_at <= now:
            session.tick(now)
    assert nothing_left > 750
    assert told > 300


def test_data_from_before_a_request_do_not_answer_it() -> None:
    """A request comes while older data is not processed yet.

    The older data does not confirm the request. Data that is received after the request confirms
    it.
    """
    session, board = opened(), SimulatedBoard(BoardSettings(running=True))
    for tick in range(200):
        session.inbound.receive(board.step(), tick * TICK_S)
    session.take_events()
    session.inbound.hear(board.step(), 2.0)
    session.request(Request.START, "asked", 2.0)
    session.inbound.process(2.0)
    assert not any(isinstance(event, RequestDone) for event in session.take_events())
    session.inbound.receive(board.step(), 2.01)
    assert RequestDone("asked", True, "running (nominal)") in session.take_events()
