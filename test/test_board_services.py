# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the services that only one kind of board has, in simulated time, without ROS."""

import inspect
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest
from any_board import AnyBench, nominal

from omnibot_driver import boards


class Services:
    """The services that a board's profile creates, connected to the session of a bench."""

    def __init__(self, board: str, bench: AnyBench) -> None:
        self._services: dict[str, tuple[Any, Callable[..., Any]]] = {}
        node = MagicMock(publishers=[SimpleNamespace(topic_name="joint_states")])
        node.resolve_topic_name = str
        node.create_service = self._add
        link = SimpleNamespace(call=lambda action: action(bench.session, bench.now))
        boards.load(board).extras(node, link, boards.check_all({"board": board}))

    def _add(self, kind: Any, name: str, callback: Callable[..., Any], **_options: object) -> None:
        self._services[name] = kind, callback

    def answers(self, *, data: bool = True, but: str | None = None) -> dict[str, tuple[bool, str]]:
        """Call each service, and return ``success`` and ``message`` of each.

        Fails if a service does not answer at once. ``data``: the value for each SetBool. ``but``:
        services whose names contain this text are not called.
        """
        answers = {}
        for name, (kind, callback) in self._services.items():
            if but is not None and but in name:
                continue
            request, response = kind.Request(), kind.Response()
            if hasattr(request, "data"):
                request.data = data
            answer = callback(request, response)
            if inspect.iscoroutine(answer):
                with pytest.raises(StopIteration) as ended:
                    answer.send(None)
                answer = ended.value.value
            answers[name] = answer.success, answer.message
        return answers


@pytest.mark.parametrize("board", boards.PROFILES)
def test_a_driver_that_shuts_down_refuses_all_services_of_the_board(board: str) -> None:
    """The driver shuts down. Every service that only this board has is refused.

    The answer of each service gives the reason.
    """
    bench = nominal(board)
    services = Services(board, bench)
    bench.session.shutdown.begin(bench.now)
    wrong = {
        name: (success, message)
        for name, (success, message) in services.answers().items()
        if success or "the driver is shutting down" not in message
    }
    assert not wrong


@pytest.mark.parametrize("data", [True, False])
@pytest.mark.parametrize("board", ["lois_ecu", "fejemis"])
def test_a_replay_refuses_the_services_whose_effect_no_data_shows(board: str, data: bool) -> None:
    """In a replay, the services that command the board fail: a replay writes nothing to a board.

    The test leaves out the ``~/record_…`` services, which wait for a record in the replay.
    """
    bench = nominal(board)
    services = Services(board, bench)
    bench.session.interlocks.obeys = False
    answers = services.answers(data=data, but="record")
    assert answers
    assert not any(success for success, _ in answers.values())
    assert all("replay writes nothing to a board" in message for _, message in answers.values())
