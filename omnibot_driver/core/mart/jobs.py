# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Jobs: requests that do not come from motion topics, such as a download. One runs at a time.

This module knows commands and replies; it does not know when the command port is free. The caller
passes the time.
"""

import math
from enum import Enum
from typing import Final

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import Answer
from omnibot_driver.core.mart.incoming_file import IncomingFile
from omnibot_driver.core.mart.readings import JobDone
from omnibot_driver.core.mart.replies import Fail, Ok
from omnibot_driver.core.mart.words import Form, Request, Word

QUIET_S: Final = 1.0
"""Time in s without a new piece of a file after which the driver ends the download.

If all bytes of the file have arrived, the driver waits for only a third of this time.
"""
RECORD_S, RECORD_QUIET_S = 0.25, 0.15
"""Times in s to wait for the record of a turn, while the robot is at rest.

``RECORD_S``: for the reply to the request, plus three average durations of a query.

``RECORD_QUIET_S``: for each further piece of the file.
"""
TIMES: Final = 3
"""Largest number of times that the driver sends the request of a job, if the job is in
``REPEATED``."""

CHECK: Final = "check controller and network"
EXIT_LOST: Final = "if the server has ended, start it again; if it still answers, call again"
KEPT: Final = "copy the file from the controller, before ~/start_log deletes it"
COPY: Final = f"the server has ended: {KEPT}"


class Job(Enum):
    """A kind of job. Its value is its name in messages."""

    BIAS = "gyro calibration"
    DOCK = "docking"
    LOG = "start of the log"
    LAST_MOVE = "download of the last move"
    LAST_TURN = "download of the last turn"
    LOG_FILE = "download of the log"
    TIME = "setting of the clock"
    TURN_RECORD = "reading of the turn's angle"


WORD_OF: Final[dict[Job, Word]] = {
    Job.BIAS: words.SB,
    Job.DOCK: words.TF,
    Job.LOG: words.LOG,
    Job.LAST_MOVE: words.LAST_MOVE,
    Job.LAST_TURN: words.LAST_TURN,
    Job.LOG_FILE: words.EXIT,
    Job.TIME: words.TIME,
    Job.TURN_RECORD: words.LAST_TURN,
}
WITHIN_S: Final[dict[Job, float]] = {Job.DOCK: 90.0}
USUAL_S: Final = 20.0
OWN: Final = frozenset({Job.TIME, Job.TURN_RECORD})
"""Jobs that the driver begins by itself. Another job can replace such a job until its request has
been sent."""
REPEATED: Final = frozenset({Job.BIAS, Job.LOG})
"""Jobs whose request may be sent again if the reply is missing."""
COMPARED: Final = frozenset({Job.LAST_MOVE, Job.LAST_TURN})
"""Downloads that the driver makes twice if the pieces of the file do not show their order.

The job succeeds only if both downloads are equal.
"""
FILES_BEGIN: Final = {
    Job.LAST_MOVE: "the file exists only after a move: drive forward or backward, then call again",
    Job.LAST_TURN: "the file exists only after a turn: turn the robot on the spot, then call again",
}
"""What the user must do to get a file of the last move or turn, if the controller has none."""
UNPROVED: Final = (
    "the pieces of the downloaded file may be in a wrong order: compare it with the original on the"
    " controller, before ~/start_log deletes the original"
)


class Jobs:
    """The job that is in progress, and the results of the jobs that have ended.

    * ``done``: results that the caller has not taken yet.
    * ``logging``: whether the server has acknowledged LOG, and so begun its log, in this
      connection.
    * ``ended``: whether EXIT was sent, which ends the server.
    * ``moving``: whether the move of a docking job was sent.
    * ``turn_record``: name and pieces of the file of the last turn; None if it was not downloaded.
    """

    def __init__(self) -> None:
        self.done: list[JobDone] = []
        self.turn_record: tuple[str, list[bytes]] | None = None
        self.forget_log()
        self.moving = False
        self._clear()

    def forget_log(self) -> None:
        """Assume that the server keeps no log: it was restarted, or the connection is new."""
        self.logging = self.log_may_be_lost = self.ended = False

    def _clear(self) -> None:
        self.job: Job | None = None
        self._token: object = None
        self._request: Request | None = None
        self._waiting = False
        self._tries = 0
        self._until_s = math.inf
        self._file: IncomingFile | None = None
        self._first: IncomingFile | None = None
        self._piece_s = math.inf
        self.moving = False

    @property
    def collecting(self) -> bool:
        """Whether the job waits for pieces of a file."""
        return self._file is not None

    @property
    def wake_at(self) -> float:
        """The time at which ``tick`` must be called again."""
        return min(self._until_s, self._piece_s)

    def progress(self, now: float) -> str:
        """Return a text with the current job, its duration and the bytes received."""
        if self.job is None:
            return "none"
        limit_s = WITHIN_S.get(self.job, USUAL_S)
        since = (
            f"{self.job.value}: {now - self._until_s + limit_s:.0f} s of at most {limit_s:.0f} s"
        )
        file = self._file
        return since if file is None else f"{since}, {file.came} of {file.size} bytes"

    def ask(self, job: Job, token: object, now: float, *arguments: object) -> None:
        """Begin a job, which replaces a job that the driver itself began and has not sent yet.

        Raises RequestRefused if another job is in progress, or if ``job`` is the download of a log
        that may not exist.
        """
        if self.job in OWN and not self._waiting:
            self._clear()
        if self.job is not None:
            raise RequestRefused(
                f"{self.job.value} is under way; wait for its answer, then call again"
            )
        if job is Job.LOG_FILE and not self.logging:
            raise RequestRefused(
                "no log was started: call ~/start_log first. Without a log, ~/download_log would"
                " only end the server"
            )
        if job is Job.LOG_FILE and self.log_may_be_lost:
            raise RequestRefused(
                "the server may have been restarted and may no longer keep a log. Without a log,"
                " ~/download_log would only end the server. Copy the old log from the controller,"
                " or call ~/start_log to delete the old log and begin a new one"
            )
        self.job, self._token, self.turn_record = job, token, None
        self._request = WORD_OF[job].request(*arguments)
        self._until_s = now + WITHIN_S.get(job, USUAL_S)

    def next(self, now: float, *, stands: bool) -> Request | None:
        """Return the job's request if it must be sent now, else None.

        ``stands``: whether measurements show that the robot is at rest. Every job except
        TURN_RECORD waits until the robot is at rest.
        """
        ready = stands or self.job is Job.TURN_RECORD
        return self._request if ready and not self._waiting else None

    def sent(self, request: Request, now: float) -> None:
        """Record that the job's request was sent."""
        self._waiting = True
        self._tries += 1
        self.moving = request.word in (words.TF, words.TB)
        self.ended |= request.word is words.EXIT

    def answered(self, answer: Answer, now: float) -> None:
        """Evaluate the reply to the job's request."""
        job, reply = self.job, answer.reply
        if job is None or self._request is None or answer.word is not self._request.word:
            return
        if isinstance(reply, Fail):
            advice = FILES_BEGIN.get(job, "call again")
            self._finish(False, f"the controller answers: {reply.reason or 'fail'}; {advice}")
        elif reply.form is Form.FILE:
            self._file = IncomingFile(*reply.file)
            self._piece_s = now + QUIET_S
        elif job is Job.LOG_FILE:
            self._finish(False, f"the controller sent no file; {COPY}")
        else:
            if job is Job.LOG:
                self.logging, self.log_may_be_lost = True, False
            self._finish(True, f"{job.value} done")

    def missed(self, word: Word, now: float) -> None:
        """Repeat or end the job: the reply to the request with the command ``word`` is missing.

        Nothing changes if ``word`` is not the command of the job.
        """
        if not self._waiting or self._request is None or word is not self._request.word:
            return
        if self.job in REPEATED and self._tries < TIMES:
            self._waiting = False
        else:
            advice = EXIT_LOST if self.ended else CHECK
            self.ended = False
            self._finish(False, f"the controller did not answer {word.text}; {advice}")

    def moved(self, reply: Ok | Fail, now: float) -> None:
        """End the docking job if the controlled move that has just ended belongs to it.

        ``reply``: the server's reply to the move.
        """
        if self.job is not Job.DOCK or not self.moving:
            return
        if isinstance(reply, Fail):
            self._finish(False, f"the controller answers: {reply.reason or 'fail'}; call again")
        else:
            self._finish(
                True,
                "the move to the dock has ended; the topic `docked` shows whether the robot is"
                " docked",
            )

    def piece(self, data: bytes, now: float) -> None:
        """Keep a datagram as a piece of the file, if its length allows that."""
        if self._file is None or not self._file.add(data):
            return
        if self.job is Job.TURN_RECORD:
            self._piece_s = now + (0.0 if self._file.complete else RECORD_QUIET_S)
        else:
            self._piece_s = now + (QUIET_S / 3 if self._file.complete else QUIET_S)

    def tick(self, now: float) -> None:
        """End a download that gets no more pieces, or a job that has taken too long."""
        if self._file is not None and now >= self._piece_s:
            self._close(self._file)
        elif self.job is not None and now >= self._until_s:
            limit_s = WITHIN_S.get(self.job, USUAL_S)
            self._finish(
                False, f"the controller did not complete the {self.job.value} within {limit_s:g} s"
            )

    def cancel(self, why: str) -> None:
        """End the job as failed.

        ``why``: the reason, a semicolon, and advice for the user. If EXIT was sent, other advice
        replaces this advice. A job that the driver itself began ends without a result.
        """
        if self.job in OWN:
            self._clear()
        elif self.job is not None:
            ended = self.ended and self._waiting
            self._finish(False, f"{why.partition(';')[0]}; {COPY}" if ended else why)

    def _close(self, file: IncomingFile) -> None:
        first, again = self._first, COPY if self.ended else "call again"
        if file.fault:
            self._finish(False, f"{file.fault}; {again}")
        elif self.ended and file.has_equal_pieces:
            self._finish(False, f"pieces of {file.name} may have come twice; {again}")
        elif self.job in COMPARED and first is None and not file.order_is_sure:
            self._first, self._file = file, None
            self._piece_s, self._waiting = math.inf, False
        elif first is not None and first.content != file.content:
            self._finish(
                False,
                f"two downloads of {file.name} differ, so pieces were lost or arrived in the"
                f" wrong order; {again}",
            )
        else:
            text = f"{file.name}, {file.came} bytes"
            if self.ended:
                text += "; the server has ended and must be started again"
                text += "" if file.order_is_sure else f"; {UNPROVED}"
            self._finish(True, text, content=file.content)

    def _finish(self, success: bool, message: str, content: bytes = b"") -> None:
        name = self._file.name if self._file is not None else ""
        if self.job is Job.TURN_RECORD:
            self.turn_record = name, self._file.pieces if self._file is not None else []
        else:
            self.done.append(JobDone(self._token, success, message, name, content))
        self._clear()
