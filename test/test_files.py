# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of files that are written completely or not at all."""

from pathlib import Path
from typing import TextIO

import pytest

from omnibot_driver.files import unused, write_whole


def test_a_file_replaces_an_older_one_with_its_very_characters(tmp_path: Path) -> None:
    """A file is written into a new folder, and is then replaced by a newer version.

    Line ends and characters beyond ASCII are kept, and no other file is left.
    """
    path = tmp_path / "new" / "move.csv"
    for text in ("old", "a\r\nb\n\u00b0"):
        assert write_whole(path, lambda file, text=text: file.write(text))  # type: ignore[misc]
        assert path.read_bytes() == text.encode()
    assert list(path.parent.iterdir()) == [path]


def test_a_write_that_fails_or_is_not_wanted_leaves_the_old_file(tmp_path: Path) -> None:
    """Writing fails half-way, or the data are not wanted any more. The old file is unchanged."""
    path = tmp_path / "move.csv"
    path.write_text("old")

    def fail(file: TextIO) -> None:
        file.write("half")
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="full"):
        write_whole(path, fail)
    assert not write_whole(path, lambda file: file.write("late"), wanted=lambda: False)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_unused_name_is_numbered_if_the_name_is_taken(tmp_path: Path) -> None:
    """A free name is returned unchanged; a taken name gets the first free number from 2 on."""
    path = tmp_path / "move.csv"
    assert unused(path) == path
    path.touch()
    assert unused(path) == tmp_path / "move-2.csv"
    (tmp_path / "move-2.csv").mkdir()
    assert unused(path) == tmp_path / "move-3.csv"
