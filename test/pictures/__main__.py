# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Make the pictures of the README and the documents, except those that no program can make.

``make pictures`` runs this program. It calls ``main(folder)`` of each module beside it, in a
separate process, two at a time.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).parent
PICTURES = HERE.parents[1] / "docs" / "pictures"


def main() -> int:
    """Run all modules, and return the number of those that failed."""
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
