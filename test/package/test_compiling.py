# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of an installation with ``OMNIBOT_DRIVER_COMPILE=1``, which compiles a part of the core.

To save time, most tests replace mypyc by code that writes one small C module. One test runs mypyc,
and replaces the C compiler by a program that does nothing.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = "omnibot_driver"
MODULE = f"{PACKAGE}.core.timing.clock_fit"
ENDING = sysconfig.get_config_var("EXT_SUFFIX")

STAND_IN = '''
from pathlib import Path
from setuptools import Extension

def mypycify(files, *, target_dir, **_):
    assert any(file.endswith("clock_fit.py") for file in files)
    {fails}
    source = Path(target_dir, "clock_fit.c")
    source.write_text("""{source}""")
    return [Extension("{module}", [str(source)])]
'''
GOOD = """
#include <Python.h>
static struct PyModuleDef it = {PyModuleDef_HEAD_INIT, "clock_fit"};
PyMODINIT_FUNC PyInit_clock_fit(void) {
    PyObject *module = PyModule_Create(&it);
    PyModule_AddObject(module, "ClockFit", Py_NewRef(Py_None));
    PyModule_AddObject(module, "Point", Py_NewRef(Py_None));
    return module;
}
"""
FAILURES = {
    "mypyc is not installed": ("raise ImportError('no mypyc')", GOOD),
    "mypyc gives up": ("raise SystemExit(1)", GOOD),
    "the compiler gives up": ("pass", "no C"),
    "what is made cannot be imported": ("pass", GOOD.replace('"Point"', '"Other"')),
}


def built(folder: Path, fails: str, source: str, *, wanted: str = "1") -> str:
    """Build the package into ``lib`` in ``folder``, and return the output of the build.

    A substitute replaces mypyc.

    ``fails``: Python statement that the substitute runs first.

    ``source``: C code that the substitute writes.

    ``wanted``: value of ``OMNIBOT_DRIVER_COMPILE``.
    """
    (folder / "stand_in/mypyc").mkdir(parents=True, exist_ok=True)
    (folder / "stand_in/mypyc/__init__.py").touch()
    (folder / "stand_in/mypyc/build.py").write_text(
        STAND_IN.format(fails=fails, source=source.replace("\\", "\\\\"), module=MODULE)
    )
    return build(folder, OMNIBOT_DRIVER_COMPILE=wanted, PYTHONPATH=str(folder / "stand_in"))


def build(folder: Path, **environment: str) -> str:
    """Build the package into ``lib`` in ``folder``, and return the output of the build."""
    folders = ["--build-base", folder / "base", "--build-lib", folder / "lib"]
    done = subprocess.run(
        [sys.executable, "setup.py", "-q", "build", *folders],
        cwd=ROOT,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def compiled_modules(folder: Path) -> list[str]:
    return [str(path.relative_to(folder)) for path in folder.rglob("*.so")]


@pytest.mark.parametrize(("fails", "source"), FAILURES.values(), ids=FAILURES)
def test_what_cannot_be_compiled_is_installed_as_it_is(
    tmp_path: Path, fails: str, source: str
) -> None:
    """Compiling fails. The plain Python modules are installed, and one line gives the reason."""
    output = built(tmp_path, fails, source)
    assert f"{PACKAGE}: not compiled (" in output
    assert not compiled_modules(tmp_path / "lib")
    for path in (ROOT / PACKAGE / "core").rglob("*.py"):
        assert (tmp_path / "lib" / path.relative_to(ROOT)).is_file(), path


@pytest.mark.skipif(
    not shutil.which((sysconfig.get_config_var("CC") or "cc").split()[0]),
    reason="no C compiler is installed",
)
def test_what_is_compiled_goes_where_the_source_is_and_goes_away_again(tmp_path: Path) -> None:
    """A build with compiled modules installs them; a later build without any removes them.

    The compiled modules are in the same place as their sources.
    """
    assert f"{PACKAGE}: core: compiled" in built(tmp_path, "pass", GOOD)
    assert compiled_modules(tmp_path / "lib") == [MODULE.replace(".", "/") + ENDING]
    assert built(tmp_path, "raise SystemExit(1)", GOOD)
    assert not compiled_modules(tmp_path / "lib")


def test_mypyc_accepts_each_module_that_is_to_be_compiled(tmp_path: Path) -> None:
    """mypyc translates the modules into C without an error. It is stricter than mypy."""
    pytest.importorskip("mypyc")
    output = build(tmp_path, OMNIBOT_DRIVER_COMPILE="1", CC="true", LDSHARED="true")
    assert f"{PACKAGE}: core: compiled" in output, output


def test_nothing_is_compiled_unless_it_is_asked_for(tmp_path: Path) -> None:
    """A build without ``OMNIBOT_DRIVER_COMPILE`` searches neither for mypyc nor for a compiler."""
    assert "compiled" not in built(tmp_path, "raise SystemExit(1)", "no C", wanted="0")
    assert not compiled_modules(tmp_path / "lib")
