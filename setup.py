# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Says what colcon and pip install, and where ``ros2 run`` and ``ros2 launch`` look for it."""

from glob import glob

from setuptools import find_packages, setup

NAME = "omnibot_driver"

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
        "test": ["pytest"],  # without it `colcon test` passes, and has run nothing
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
)
