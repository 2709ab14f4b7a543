# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of services that save a file while the computer is at its limit of processes."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from std_srvs.srv import Trigger

from omnibot_driver.boards.lois_ecu_record_topics import Recorder
from omnibot_driver.boards.mart_topics import MartTopics
from omnibot_driver.core.lois_ecu import RecordKind
from omnibot_driver.core.mart.jobs import KEPT, Job
from omnibot_driver.core.mart.readings import JobDone
from omnibot_driver.services import Services

NO_THREAD = "can't start new thread"
NODE = SimpleNamespace(executor=None)


@pytest.fixture(autouse=True)
def _no_thread_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_thread: object) -> None:
        raise RuntimeError(NO_THREAD)

    monkeypatch.setattr("threading.Thread.start", refuse)


def finished(coroutine: Any) -> Any:
    """Run the coroutine, which must not wait for anything, and return its result."""
    with pytest.raises(StopIteration) as end:
        coroutine.send(None)
    return end.value.value


def test_a_gyro_bias_that_no_thread_can_save_is_answered(tmp_path: Path) -> None:
    """The gyro's bias is measured, but the computer cannot start a thread to save the bias.

    The service fails. Its answer says that the bias is applied, but not saved.
    """
    services, response = SimpleNamespace(_node=NODE), Trigger.Response(success=True, message="ok")
    finished(Services._save(services, tmp_path / "bias.yaml", [0.0, 0.0, 0.0], response))
    assert not response.success
    assert response.message == f"ok; it is applied, but not saved: {NO_THREAD}"


def test_a_download_that_no_thread_can_save_is_answered() -> None:
    """A file of a MART is downloaded, but the computer cannot start a thread to save the file.

    The service fails. Its answer says that the file is not saved.
    """
    services, done = SimpleNamespace(_node=NODE), SimpleNamespace(message="downloaded")
    answer = finished(MartTopics._save(services, done))
    assert answer == (False, f"downloaded; not saved: {NO_THREAD}")


def test_a_log_that_is_not_saved_is_to_be_copied_before_the_next_log_deletes_it() -> None:
    """The log of a MART is downloaded but not saved. The server has ended and cannot send it again.

    The answer says that the file is still on the controller, and what would delete it.
    """

    async def ask(_job: Job, _arguments: tuple[object, ...]) -> JobDone:
        return JobDone(None, True, "x.log, 3 bytes; the server has ended", "x.log", b"abc")

    services = SimpleNamespace(_node=NODE, _ask=ask)
    services._save = lambda done: MartTopics._save(services, done)
    serve = MartTopics._service(services, Job.LOG_FILE)
    answer = finished(serve(Trigger.Request(), Trigger.Response()))
    assert not answer.success
    assert f"not saved: {NO_THREAD}; {KEPT}" in answer.message


def test_a_record_that_no_thread_can_save_is_answered() -> None:
    """A LOIS ECU sends a record, but the computer cannot start a thread to save the record.

    The service fails. Its answer says that the record could not be saved.
    """
    answers: list[tuple[object, ...]] = []
    token = object()
    recorder = SimpleNamespace(
        _token=token, _save=print, _end=lambda *answer: answers.append(answer)
    )
    recorder._end_unsaved = lambda *what: Recorder._end_unsaved(recorder, *what)
    reading = SimpleNamespace(record=SimpleNamespace(kind=RecordKind.RPM))
    Recorder._on_record(recorder, reading, 0)
    text = f"the record of RPM was received, but could not be saved: {NO_THREAD}"
    assert answers == [(token, False, text)]
