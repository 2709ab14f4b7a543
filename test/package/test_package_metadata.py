# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the package's metadata, and of which parts of the package may import which."""

import ast
import re
import runpy
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import setuptools

ROOT = Path(__file__).parents[2]
PACKAGE = "omnibot_driver"
CORE = f"{PACKAGE}.core"

# rosdep keys of libraries by the name that Python imports. For a ROS package, both are the same.
ROSDEP_KEYS = {
    "hypothesis": "python3-hypothesis",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "serial": "python3-serial",
    "setuptools": "python3-setuptools",
    "urdf_parser_py": "urdfdom_py",
    "yaml": "python3-yaml",
}

# Packages that launch files can start and a driver does not need; the README names them.
OPTIONAL = {"robot_localization", "rviz2"}

# Libraries that the driver itself does not need, by the extra with which pip installs them.
EXTRAS = {
    "replay": ["rosbags"],
    "tools": ["matplotlib", "numpy", "rich", "rosbags", "scipy", "textual"],
}

# rosdep does not install these two libraries in a suitable version. It would get rosbags from pip,
# which Ubuntu 24.04 refuses, and textual in the distribution's version. The README says how to
# install both.
FROM_PIP = {"rosbags", "textual"}

# Modules for values and arithmetic; none waits, reads a clock or has side effects.
PURE_MODULES = {
    "__future__",
    "abc",
    "bisect",
    "calendar",
    "cmath",
    "collections",
    "copy",
    "dataclasses",
    "enum",
    "functools",
    "itertools",
    "math",
    "operator",
    "re",
    "statistics",
    "struct",
    "types",
    "typing",
}

MANIFEST = ElementTree.parse(ROOT / "package.xml").getroot()


def declared(tag: str) -> set[str]:
    """Return the rosdep keys in all elements of the manifest with the name ``tag``."""
    return {element.text or "" for element in MANIFEST.iter(tag)}


def python_files(*paths: str) -> list[Path]:
    """Return the Python files at and below the paths, which are relative to the repository."""
    files = [
        file
        for path in paths
        for file in ([ROOT / path] if path.endswith(".py") else (ROOT / path).rglob("*.py"))
    ]
    assert files, f"nothing to check in {paths}"
    return files


def statements(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield every statement of a module, including the statements within other statements."""
    waiting: list[Any] = [*tree.body]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.stmt):
            yield node
        for name in ("body", "handlers", "cases", "orelse", "finalbody"):
            waiting += getattr(node, name, ())


@cache
def imports(file: Path) -> list[str]:
    """Return the full dotted name of everything that a file imports, in any place of the file."""
    package = file.relative_to(ROOT).parent.parts
    found: list[str] = []
    for node in statements(ast.parse(file.read_text(), file)):
        if isinstance(node, ast.Import):
            found += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            parts = (*parents, *filter(None, [node.module]))
            found += (".".join((*parts, alias.name)) for alias in node.names)
    return found


def third_party(files: Iterable[Path]) -> set[str]:
    """Return the rosdep keys of libraries that these files import.

    Python's own modules, those of this repository and ``FROM_PIP`` are left out.
    """
    files = list(files)
    own = {PACKAGE}  # tests import their helpers by bare name
    own |= {file.stem for file in files} | {"toys"}
    own |= FROM_PIP
    top_level = {name.partition(".")[0] for file in files for name in imports(file)}
    return {ROSDEP_KEYS.get(name, name) for name in top_level - sys.stdlib_module_names - own}


def started_by(files: Iterable[Path]) -> set[str]:
    """Return the packages whose executables the launch files start."""
    return {
        ast.literal_eval(keyword.value)
        for file in files
        for node in ast.walk(ast.parse(file.read_text(), file))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("Node", "FindExecutable")
        for keyword in node.keywords
        if keyword.arg == ("package" if ast.unparse(node.func) == "Node" else "name")
    } - {PACKAGE}


def within(name: str, module: str) -> bool:
    """Return whether the dotted ``name`` is the module itself or something in it."""
    return name == module or name.startswith(f"{module}.")


@pytest.fixture
def setup_arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what setup.py passes to setuptools."""
    captured: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: captured.update(arguments))
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    return captured


def test_manifest_and_setup_agree(setup_arguments: dict[str, Any]) -> None:
    """package.xml and setup.py contain the same facts, for ROS and for Python."""
    for key in ("name", "version", "license"):
        assert setup_arguments[key] == MANIFEST.findtext(key)
    assert setup_arguments["maintainer"] == MANIFEST.findtext("maintainer")


def test_what_pip_brings_is_asked_for_by_an_extra(setup_arguments: dict[str, Any]) -> None:
    """``setup.py`` declares optional libraries as extras for pip. The driver does not need them."""
    assert setup_arguments["extras_require"] == {**EXTRAS, "test": ["pytest"]}


def test_only_tools_need_what_an_extra_brings() -> None:
    """Only the tools import libraries of the extras, with one exception: rosbags.

    rosbags is also imported by the two modules that open recordings for a replay.
    """
    optional = {name for names in EXTRAS.values() for name in names}
    needing = {
        (file.relative_to(ROOT / PACKAGE).parts[0], library)
        for file in python_files(PACKAGE)
        for name in imports(file)
        if (library := name.partition(".")[0]) in optional
    }
    assert {library for _, library in needing} == optional
    assert {item for item in needing if item[0] != "tools"} == {
        ("bag_files.py", "rosbags"),
        ("recording.py", "rosbags"),
    }


def test_the_readme_names_all_libraries_of_the_tools() -> None:
    """Without rosdep, users install the libraries of the tools by a pip command in the README."""
    words = f"`pip install {' '.join(EXTRAS['tools'])}`"
    assert words in (ROOT / "README.md").read_text()


def test_what_rosdep_does_not_bring_the_readme_has_pip_bring() -> None:
    """The README has a pip command for two libraries that rosdep cannot install.

    rosdep has no suitable versions of them. The command has the option that Ubuntu 24.04 requires.
    """
    words = f"pip install --user --break-system-packages {' '.join(sorted(FROM_PIP))}"
    assert words in (ROOT / "README.md").read_text()


def test_every_entry_point_names_a_function(setup_arguments: dict[str, Any]) -> None:
    """Each executable's module exists and defines the function that it starts."""
    for script in setup_arguments["entry_points"]["console_scripts"]:
        module, function = script.partition("=")[2].strip().split(":")
        tree = ast.parse((ROOT / module.replace(".", "/")).with_suffix(".py").read_text())
        assert function in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_manifest_declares_what_the_package_needs_and_nothing_else() -> None:
    """package.xml declares exactly what the package needs. Optional packages are not declared."""
    started = started_by(python_files("launch"))
    needed = third_party(python_files(PACKAGE, "launch")) | (started - OPTIONAL)
    assert needed == declared("exec_depend")


def test_optional_packages_are_started_and_documented() -> None:
    """Launch files start the optional packages, which rosdep does not install.

    The README says how to install them.
    """
    readme = (ROOT / "README.md").read_text()
    assert started_by(python_files("launch")) >= OPTIONAL
    for name in OPTIONAL:
        assert f"ros-jazzy-{name.replace('_', '-')}" in readme


def test_manifest_declares_what_the_tests_import() -> None:
    """``rosdep install --with-test`` installs all that ``colcon test`` needs."""
    needed = third_party(python_files("test")) - declared("exec_depend")
    assert needed == declared("test_depend")


@pytest.mark.parametrize("path", sorted((ROOT / "launch").iterdir()), ids=lambda path: path.name)
def test_launch_file_describes_a_launch(path: Path) -> None:
    """A launch file has the right ending, compiles, and defines what ``ros2 launch`` calls."""
    assert path.name.endswith(".launch.py")
    tree = ast.parse(path.read_text(), path)
    compile(tree, path, "exec")
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert "generate_launch_description" in functions


def test_the_core_imports_itself_and_pure_modules_only() -> None:
    """The core does not import ROS, serial ports, threads, clocks or files."""
    foreign = {
        f"{file.relative_to(ROOT)}: {name}"
        for file in python_files(f"{PACKAGE}/core")
        for name in imports(file)
        if not within(name, CORE) and name.partition(".")[0] not in PURE_MODULES
    }
    assert not foreign


def test_the_simulator_shares_nothing_with_the_core() -> None:
    """The simulator uses no code of the driver.

    Otherwise one misreading of a manual could affect both, and no test would detect it.
    """
    shared = {
        f"{file.relative_to(ROOT)}: {name}"
        for file in python_files(f"{PACKAGE}/simulator")
        for name in imports(file)
        if within(name, PACKAGE) and not within(name, f"{PACKAGE}.simulator")
    }
    assert not shared


def test_mypy_checks_exactly_what_imports_no_ros() -> None:
    """mypy checks all modules that do not import ROS. ROS itself has no type annotations."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    without_ros = {
        file
        for file in python_files(PACKAGE)
        if all(key.startswith("python3-") for key in third_party([file]))
    }
    mypy = settings["tool"]["mypy"]
    checked = {
        file
        for file in python_files(*mypy["files"])
        if not re.search(mypy["exclude"], str(file.relative_to(ROOT)))
    }
    assert checked == without_ros


def test_the_hook_of_git_has_the_formatter_of_the_tests() -> None:
    """The pre-commit hook and ``make lint`` use the same version of ruff."""
    (version,) = re.findall(r"rev: v(\S+)", (ROOT / ".pre-commit-config.yaml").read_text())
    assert f"ruff=={version}\n" in (ROOT / "requirements/test.txt").read_text()


def test_every_source_file_says_whose_it_is() -> None:
    """The first line of each source file names the maintainer of package.xml, and the licence."""
    line = f"# Copyright {MANIFEST.findtext('maintainer')}. SPDX-License-Identifier: Apache-2.0"
    files = python_files(PACKAGE, "docs", "launch", "test", "setup.py")
    without = [str(file) for file in files if file.read_text().partition("\n")[0] != line]
    assert not without, f"the first line must be: {line}"
