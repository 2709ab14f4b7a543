# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every picture of the README and the documents that a tool makes: ``make pictures``.

Each module here has a ``main(folder)`` that writes pictures into the folder; each runs in a process
of its own, two at once, as most of them wait for robots that drive in real time.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).parent
PICTURES = HERE.parents[1] / "docs" / "pictures"


def main() -> int:
    """Return the number of modules that failed."""
    with ThreadPoolExecutor(2) as pool:
        return sum(pool.map(_fails, sorted(HERE.glob("[!_]*.py"))))


def _fails(file: Path) -> bool:
    print(file.stem, flush=True)
    folders = (HERE, HERE.parent, HERE.parent / "system")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))}
    program = f"import {file.stem}, pathlib; {file.stem}.main(pathlib.Path({str(PICTURES)!r}))"
    return subprocess.run([sys.executable, "-c", program], env=environment).returncode != 0


if __name__ == "__main__":
    sys.exit(main())
