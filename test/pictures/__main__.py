# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every picture of the README and the documents that a tool makes: ``make pictures``.

Each module here has a ``main(folder)`` that writes pictures into the folder; each runs in a process
of its own.
"""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
PICTURES = HERE.parents[1] / "docs" / "pictures"


def main() -> int:
    """Return the number of modules that failed."""
    folders = (HERE, HERE.parent, HERE.parent / "system")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))}
    failures = 0
    for file in sorted(HERE.glob("[!_]*.py")):
        print(file.stem, flush=True)
        program = f"import {file.stem}, pathlib; {file.stem}.main(pathlib.Path({str(PICTURES)!r}))"
        done = subprocess.run([sys.executable, "-c", program], env=environment, check=False)
        failures += done.returncode != 0
    return failures


if __name__ == "__main__":
    sys.exit(main())
