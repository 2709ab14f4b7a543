# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the repository's English: phrases that were hard to read are rejected.

A phrase matches whole words, also across a line break; names such as ``nobody_waits`` do not match.
"""

import ast
import os
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SUFFIXES = {".cfg", ".md", ".py", ".rst", ".rules", ".service", ".toml", ".xacro", ".xml", ".yaml"}
SKIPPED = {"build", "install", "log"}
"""Folders of generated files, which are not searched."""

PATTERNS = {
    "mend": r"mend(s|ed|ing)?",
    "is no X": r"(there )?(is|are|was|were) no(?! (longer|more|need|different)\b)",
    "nobody": r"nobody",
    "whoever": r"whoever",
    "likewise": r"likewise",
    "all the same": r"all the same(?! time)",
    "it is told": r"(is|are|was|were|be|been|being) told",
    "so many": r"so (many|long|much)(?! (as|of|that)\b)",
    "counts as no": r"counts? as no",
    "is not finite and counts": r"is not finite and",
    "stood still for": r"the driver stood still",
    "until a new command comes": r"until a new command comes",
    "nothing comes from": r"nothing comes from",
    "hears us": r"the board (does not hear|hears) us",
    "is to stand": r"although it is to stand",
    "nobody commands": r"the robot stands$",
    "the wire said": r"the wire said",
    "takes nothing": r"the port takes nothing",
    "follows when": r"the stop follows when",
    "worth nothing": r"worth nothing",
    "makes sense": r"nothing that comes in makes sense",
    "lattice": r"lattices?",
    "farewell": r"farewells?",
}
"""The phrases that must not be used, each with a pattern. A pattern matches only whole words."""

ALLOWED = {
    "test/package/test_plain_english.py": "names the phrases",
}
"""Files that are not searched, each with the reason."""

WITHIN_A_WORD = re.compile(r"(?<=\w)")

CONJUNCTIONS = {"And", "But", "Nor", "Or"}
"""Words that must not begin a docstring.

A docstring that begins with such a word only continues the function's name, and cannot be
understood alone.
"""


@cache
def texts() -> dict[str, str]:
    """Return the text of every text file of the repository, by file name."""
    names = []
    for folder, below, files in os.walk(ROOT):
        below[:] = [name for name in below if name not in SKIPPED and not name.startswith(".")]
        names += [
            Path(folder, name).relative_to(ROOT) for name in files if not name.startswith(".")
        ]
    return {
        str(name): (ROOT / name).read_text(encoding="utf-8")
        for name in sorted(names)
        if name.suffix in SUFFIXES or name.name == "Makefile"
    }


@cache
def found() -> dict[str, list[str]]:
    """Return the places of each phrase that occurs: the file, the line and the words."""
    places: dict[str, list[str]] = {}
    lowered = {name: text.lower() for name, text in texts().items() if name not in ALLOWED}
    for phrase, one in PATTERNS.items():
        # Python searches faster if a pattern begins with a letter, as most do here. So the
        # character before a match is checked afterwards.
        pattern = re.compile(rf"(?:{one})(?!\w)".replace(" ", r"(?: |\s*\n[\s#|]*)"), re.MULTILINE)
        for name, text in lowered.items():
            for match in pattern.finditer(text):
                if WITHIN_A_WORD.match(text, match.start()):
                    continue  # it begins within a word
                if match[0].startswith("there"):  # "there is no parameter" is usual
                    continue
                place = f"{name}:{text.count(chr(10), 0, match.start()) + 1}: {match[0]}"
                places.setdefault(phrase, []).append(place)
    return places


@pytest.mark.parametrize("phrase", PATTERNS)
def test_the_phrase_is_not_used(phrase: str) -> None:
    """No text contains ``phrase``. CONTRIBUTING.md has examples of better sentences."""
    places = "\n".join(found().get(phrase, ()))
    assert not places, (
        f'please write this in other words; "Write plain English" in CONTRIBUTING.md has'
        f" examples. PATTERNS has all phrases that are rejected.\n{places}"
    )


def test_no_docstring_begins_with_a_conjunction() -> None:
    """No docstring begins with a conjunction, because such a docstring needs its context."""
    possible = re.compile(rf"""["'\\]\s*(?:{"|".join(CONJUNCTIONS)})\b""")
    fragments = [
        f"{name}: {doc.splitlines()[0]}"
        for name, text in texts().items()
        if name.endswith(".py") and possible.search(text)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.AsyncFunctionDef | ast.ClassDef | ast.FunctionDef | ast.Module)
        and (doc := ast.get_docstring(node))
        and doc.split()[0] in CONJUNCTIONS
    ]
    assert fragments == []


def test_every_file_with_an_exception_exists() -> None:
    """Every file in ``ALLOWED`` still exists."""
    assert set(ALLOWED) <= set(texts())
