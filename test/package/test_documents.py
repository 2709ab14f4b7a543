# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the documents and of the site that is built from them.

Generated parts are current, and all links and commands exist.
"""

import re
import runpy
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from omnibot_driver import boards

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
GENERATED: dict[str, Callable[[], str]] = runpy.run_path(str(ROOT / "docs/generate.py"))[
    "GENERATED"
]
NAMES = {name for board in boards.PROFILES for name in boards.load(board).PARAMETERS.by_name}
"""Names of the parameters of all boards."""
OTHERS_PARAMETERS = {"repeat_rate", "speed", "use_sim_time", "max_linear_sped"}
SPHINX = ("sphinx", "myst_parser", "sphinx_rtd_theme")
BUILD = """
import gc, sys
from sphinx.builders.html import StandaloneHTMLBuilder
from sphinx.cmd.build import main
gc.disable()
StandaloneHTMLBuilder.search = False
sys.exit(main(sys.argv[1:]))
"""
"""Code that runs Sphinx without the index for the search, and without garbage collection.

The index and the garbage collection would take a quarter of the time of a build.
"""


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def anchors(page: Path) -> set[str]:
    """Return the anchors of the page's headings on GitHub and on the documentation's web site."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", text).strip().lower().replace(" ", "-") for text in headings}


def found(pattern: str) -> Iterator[str]:
    """Yield the text of the group in ``pattern``, for every match in the documents."""
    for page in PAGES:
        yield from re.findall(pattern, page.read_text())


@pytest.mark.parametrize("name", GENERATED)
def test_what_is_generated_is_what_the_code_says(name: str) -> None:
    """Generated parts of the documents are exactly what ``make docs`` writes."""
    assert (ROOT / name).read_text(encoding="utf-8") == GENERATED[name](), (
        "run: .venv/bin/python docs/generate.py"
    )


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_somewhere(page: Path) -> None:
    """The file of each link exists. If a link names a heading, the heading exists, too."""
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if re.match(r"https?://|mailto:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_no_row_has_lost_its_table(page: Path) -> None:
    """All rows of a table follow its heading without a blank line, which would end the table."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert re.search(r"\A.*\n\|[-:| ]+\|\n", block), block


def test_every_page_can_be_reached_from_the_readme() -> None:
    """The README has a link to each page, so readers find the page without a search."""
    readme = (ROOT / "README.md").read_text()
    for page in set(ROOT.glob("docs/**/*.md")) - {ROOT / "docs/index.md"}:
        assert f"({page.relative_to(ROOT)}" in readme, page


def test_every_command_exists() -> None:
    """Commands in the documents name only what exists.

    Executables, launch files, arguments, make's targets, parameters and services are checked.
    """
    scripts = re.findall(r'f"(\w+) = \{NAME\}', (ROOT / "setup.py").read_text())
    assert {*found(r"ros2 run omnibot_driver\s+([a-z_]+)")} <= set(scripts)
    launches = {path.name for path in (ROOT / "launch").iterdir()}
    assert {*found(r"ros2 launch omnibot_driver\s+([\w.]+)")} <= launches
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert {*found(r"`make ([a-z]+)[ `]")} <= set(targets)
    assert {*found(r" -p '?([a-z_]+):=")} - OTHERS_PARAMETERS <= NAMES
    code = "".join(file.read_text() for file in (ROOT / "omnibot_driver").rglob("*.py"))
    services = re.findall(r'create_service\(\s*\w+, "~/(\w+)"', code)
    assert {*found(r"ros2 service call /omnibot_driver/(\w+)")} <= set(services)
    assert {*found(r"ros2 param \w+ /omnibot_driver (\w+)")} <= NAMES


@pytest.mark.skipif(
    not all(map(find_spec, SPHINX)), reason="Sphinx, its theme or myst-parser is not installed"
)
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """Sphinx builds the site without a warning, with every page, the README and the changelog."""
    # From CPython 3.13 on, code given with -c would count as the source of each named tuple.
    command = [sys.executable, "-", "-q", "-W", "-c", "docs", ".", str(tmp_path)]
    done = subprocess.run(
        command, cwd=ROOT, input=BUILD, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    for page in [*PAGES, ROOT / "CHANGELOG.rst"]:
        assert (tmp_path / page.relative_to(ROOT)).with_suffix(".html").is_file()
    assert "docs/index.html" in (tmp_path / "index.html").read_text()
