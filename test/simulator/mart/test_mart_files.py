# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of file downloads from the public server, and of EXIT, which ends the server."""

import pytest
from mart_rig import Rig


def download(rig: Rig, text: str) -> tuple[str, int, list[bytes]]:
    """Send the request ``text``; return name, size and blocks of the file in the reply."""
    before = len(rig.replies)
    rig.say(text)
    rig.run(0.1)
    head, *blocks = [data for _, data in rig.replies[before:]]
    ok, name, size = head.decode("ascii").split()
    assert ok == "ok"
    return name, int(size), blocks


@pytest.mark.parametrize(
    ("start", "end", "text", "name"),
    [
        ("F", "SM", "LAST MOVE", "LinearMotionSensorData"),
        ("B", "SM", "LAST MOVE", "LinearMotionSensorData"),
        ("RM 30", "SRM", "LAST MOVE", "RefMotionData"),
        ("TF 12", None, "LAST MOVE", "TLinearMotionSensorData"),
        ("R", "SM", "LAST TURN", "SpinSensorData"),
        ("MCL 30", None, "LAST TURN", "MCSpinSensorData"),
    ],
)
def test_a_file_comes_in_datagrams_of_512_bytes(
    start: str, end: str | None, text: str, name: str
) -> None:
    """The file of a motion is downloaded: its name and size first, then blocks of 512 bytes."""
    rig = Rig()
    answer = rig.ask(start)
    assert answer is not None
    assert answer.startswith("ok")
    rig.run(1.0)
    if end:
        rig.ask(end)
    found, size, blocks = download(rig, text)
    assert found.startswith(name)
    assert found.endswith(".csv")
    assert sum(map(len, blocks)) == size > 512
    assert all(len(block) == 512 for block in blocks[:-1])
    assert 0 < len(blocks[-1]) <= 512
    assert rig.ask("HELLO") == "ok BBB"


def test_files_are_latin_1_and_0xb0_is_the_sign_of_a_degree() -> None:
    """Files are in Latin-1 and contain the byte 0xB0, the degree sign.

    So they are not valid UTF-8.
    """
    rig = Rig()
    rig.ask("TF 12")
    content = b"".join(download(rig, "LAST MOVE")[2])
    assert b"\xb0/sec" in content
    assert "Motion error: " in content.decode("latin-1")
    with pytest.raises(UnicodeDecodeError):
        content.decode("utf-8")


def test_log_deletes_earlier_files_then_last_move_answers_a_bare_fail() -> None:
    """The first start of the log (LOG) deletes earlier files, and a second LOG deletes nothing.

    After the first LOG, a download of an earlier file fails.
    """
    rig = Rig()
    rig.ask("TF 5")
    assert rig.ask("LOG") == "ok"
    rig.say("LAST MOVE")
    assert rig.run(0.1) == ["fail"]
    rig.ask("TF 5")
    assert rig.ask("LOG") == "ok"
    assert download(rig, "LAST MOVE")[1] > 0


def test_exit_downloads_the_log_if_log_was_given() -> None:
    """A log was started (LOG). EXIT sends the log file and ends the server."""
    rig = Rig()
    rig.ask("LOG")
    rig.ask("HELLO")
    name, size, blocks = download(rig, "EXIT")
    content = b"".join(blocks)
    assert name.startswith("MotionController")
    assert name.endswith(".log")
    assert len(content) == size
    assert b"HELLO" in content
    assert b"ok BBB" in content
    assert rig.server.crashed == "EXIT"
    assert rig.ask("HELLO") is None


def test_exit_without_log_answers_nothing_and_ends_the_server() -> None:
    """No log was started. EXIT ends the server without an answer."""
    rig = Rig()
    assert rig.ask("EXIT") is None
    assert rig.server.crashed == "EXIT"


def test_exit_stops_no_motor() -> None:
    """EXIT ends the server during a motion. The motion continues."""
    rig = Rig()
    rig.drive("RM 30")
    rig.say("EXIT")
    rig.run(30.0)
    assert rig.moving
