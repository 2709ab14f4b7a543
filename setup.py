# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What colcon and pip install, and where ``ros2 run`` and ``ros2 launch`` find it.

With ``OMNIBOT_DRIVER_COMPILE=1``, mypyc compiles core modules. If this fails, plain Python is
installed.
"""

import os
import subprocess
import sys
import tempfile
from glob import glob
from pathlib import Path

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.install_lib import install_lib

NAME = "omnibot_driver"
CORE = f"{NAME}/core"

COMPILED = ("geometry/se2", "geometry/twist", "imu/*", "measurement/*", "odometry/*", "timing/*")
COMPILED_OF_OMNIBOT = (
    *("cost_model", "decoder", "fast_path", "frame_schedule", "gaps", "late_reads", "lower_bound"),
    *("misconfiguration", "modes", "schedule", "sequence", "single_imu", "translation", "trellis"),
)
"""``COMPILED``, ``COMPILED_OF_OMNIBOT``: the modules that mypyc compiles. Not compiled:

* modules that decide whether a robot moves, so that they run as they were debugged
* base classes
* frames, because plain dataclasses are created faster
"""


class CompileCore(build_ext):
    """The build step that compiles the core, completely or not at all.

    A core that is compiled only in part is never installed.
    """

    def run(self) -> None:
        """Compile the core. Never raises, because the package also works as plain Python."""
        if self.inplace:
            print(f"{NAME}: not compiled, as in each development installation; core: interpreted")
            return
        remove_compiled(self.build_lib)
        try:
            self._compile()
        except (Exception, SystemExit) as error:  # mypyc calls exit for code that it cannot compile
            remove_compiled(self.build_lib)
            self.distribution.ext_modules = []
            print(f"{NAME}: not compiled ({error!r}); core: interpreted", file=sys.stderr)

    def get_outputs(self) -> list[str]:
        """Return the paths of the compiled files."""
        return [str(path) for path in compiled_in(self.build_lib)]

    def _compile(self) -> None:
        from mypyc.build import mypycify

        modules = [
            *(f"{CORE}/{name}.py" for name in COMPILED),
            *(f"{CORE}/omnibot/{name}.py" for name in COMPILED_OF_OMNIBOT),
        ]
        files = [file for pattern in modules for file in sorted(glob(pattern))]
        with tempfile.TemporaryDirectory() as sources:
            self.distribution.ext_modules = mypycify(
                [file for file in files if not file.endswith("__init__.py")],
                opt_level="2",
                debug_level="0",
                group_name=NAME,
                target_dir=sources,
            )
            builder = build_ext(self.distribution)
            builder.build_lib, builder.build_temp = self.build_lib, sources
            builder.ensure_finalized()
            builder.run()
        environment = {**os.environ, "PYTHONPATH": os.path.abspath(self.build_lib)}
        command = f"import {NAME}.core.session, {NAME}.core.omnibot"
        subprocess.run([sys.executable, "-P", "-c", command], env=environment, check=True)
        print(f"{NAME}: core: compiled")


class InstallAnew(install_lib):
    """The install step that first removes the compiled modules of an earlier installation.

    Python would use them instead of the new sources.
    """

    def install(self) -> list[str]:
        """Remove the compiled modules of an earlier installation, then install."""
        remove_compiled(self.install_dir)
        return super().install()


def compiled_in(folder: str) -> list[Path]:
    """Return the modules that mypyc compiled, and the files that they share."""
    return [*Path(folder).glob(f"{NAME}__mypyc.*"), *Path(folder, CORE).rglob("*.so")]


def remove_compiled(folder: str) -> None:
    """Remove the compiled modules, so that Python runs the sources."""
    for path in compiled_in(folder):
        path.unlink()


def compiling() -> dict[str, object]:
    """Return the arguments for setuptools. ``CompileCore`` finds the modules to compile."""
    commands = {"build_ext": CompileCore, "install_lib": InstallAnew}
    if os.environ.get("OMNIBOT_DRIVER_COMPILE", "0") in ("", "0"):
        return {"cmdclass": commands}
    return {"cmdclass": commands, "ext_modules": [Extension(f"{NAME}.core", [])]}


setup(
    name=NAME,
    version="0.1.0",
    description="ROS 2 driver for the motor boards of mobile robots",
    maintainer="OmniBot driver developers",
    maintainer_email="maintainers@example.org",
    license="Apache-2.0",
    python_requires=">=3.11",
    install_requires=["pyserial", "PyYAML"],
    extras_require={
        "replay": ["rosbags"],
        "test": ["pytest"],  # without pytest, `colcon test` passes but runs nothing
        "tools": ["matplotlib", "numpy", "rich", "rosbags", "scipy", "textual"],
    },
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "LICENSE", *glob("*.md"), *glob("*.rst")]),
        (f"share/{NAME}/docs", glob("docs/*.md")),
        *(
            (f"share/{NAME}/{folder}", glob(f"{folder}/*.*"))
            for folder in (
                "config",
                "docs/boards",
                "docs/internals",
                "docs/pictures",
                "docs/tools",
                "launch",
                "rviz",
                "systemd",
                "udev",
                "urdf",
            )
        ),
    ],
    entry_points={
        "console_scripts": [
            f"calibrate = {NAME}.tools.calibrate.__main__:main",
            f"demo = {NAME}.demo.__main__:main",
            f"driver = {NAME}.driver:main",
            f"monitor = {NAME}.tools.monitor.__main__:main",
            f"report = {NAME}.tools.report.__main__:main",
            f"simulator = {NAME}.simulator.__main__:main",
        ],
    },
    zip_safe=False,
    **compiling(),
)
