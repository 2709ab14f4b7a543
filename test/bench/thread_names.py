# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Write the native id and the name of each thread to the file in the environment variable NAMES.

The driver's process imports this module before the driver starts.
"""

import os
import threading
from pathlib import Path

_names = Path(os.environ["NAMES"])
_run = threading.Thread.run


def _named_run(thread: threading.Thread) -> None:
    with _names.open("a") as names:
        names.write(f"{threading.get_native_id()} {thread.name}\n")
    _run(thread)


threading.Thread.run = _named_run  # type: ignore[method-assign]
