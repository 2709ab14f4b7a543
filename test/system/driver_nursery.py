# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A nursery for driver processes: one process imports the driver and forks each driver process.

A forked driver starts fast. Tests of the start itself run a new interpreter instead.
"""

import atexit
import contextlib
import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

LARGEST_REQUEST = 1 << 17
"""Maximum size, in bytes, of a request to the nursery. The end of a larger request is lost.

A request contains a driver's arguments and environment, and Python code to run before the driver.
"""


class Forked:
    """A driver process that was forked, with the methods of ``Popen`` that tests use."""

    def __init__(self, pid: int, output: int, status: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdout = open(output, encoding="utf-8")  # noqa: SIM115, closed by its user
        self._status = status
        self._lock = threading.Lock()

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code. Raise subprocess.TimeoutExpired if the driver still runs."""
        with self._lock:
            if self.returncode is None:
                if not select.select([self._status], [], [], timeout)[0]:
                    raise subprocess.TimeoutExpired(f"driver {self.pid}", timeout or 0.0)
                self.returncode = int(os.read(self._status, 16))
                os.close(self._status)
            return self.returncode

    def poll(self) -> int | None:
        """Return the exit code, or None while the driver runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.wait(0.0)
        return None

    def send_signal(self, number: int) -> None:
        """Send a signal to the driver, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Nursery:
    """The connection to the process that imports the driver once and forks each driver process.

    The process starts with the first driver, and ends with the tests.
    """

    def __init__(self) -> None:
        self._control: socket.socket | None = None
        self._lock = threading.Lock()

    def start(
        self, arguments: Sequence[str], environment: Mapping[str, str], before: str = ""
    ) -> Forked:
        """Fork a driver with these arguments and this environment.

        ``before``: Python code that runs in the forked process before the driver.
        """
        request = json.dumps([list(arguments), dict(environment), before]).encode()
        output, driver_output = os.pipe()
        status, driver_status = os.pipe()
        with self._lock:
            control = self._control = self._control or self._begin()
            socket.send_fds(control, [request], [driver_output, driver_status])
            os.close(driver_output)
            os.close(driver_status)
            pid = int(control.recv(16))
        return Forked(pid, output, status)

    def _begin(self) -> socket.socket:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        folder = str(Path(__file__).parent)
        main = f"import sys; sys.path.append({folder!r}); import driver_nursery as nursery"
        process = subprocess.Popen(
            [sys.executable, "-c", f"{main}; nursery.serve({theirs.fileno()})"],
            pass_fds=[theirs.fileno()],
            env={**os.environ, "PYTHONUNBUFFERED": "1", "OPENBLAS_NUM_THREADS": "1"},
        )
        theirs.close()
        atexit.register(end, ours, process)
        return ours


def end(control: socket.socket, process: "subprocess.Popen[bytes]") -> None:
    """Close the control socket, and wait until the process that forks the drivers has ended."""
    control.close()
    process.wait()


def serve(descriptor: int) -> None:
    """Fork a driver for each request that arrives on the socket ``descriptor``.

    Two pipes come with each request: one for the driver's output, and one for its exit code.
    """
    import omnibot_driver.node  # noqa: F401, which takes most of the time
    from omnibot_driver import boards

    for name in boards.PROFILES:
        with contextlib.suppress(ModuleNotFoundError):
            boards.load(name)
    gc.freeze()
    control = socket.socket(fileno=descriptor)
    wakes, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ctrl-C ends the tests, which end the nursery
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake)
    statuses: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([control, wakes], [], [])
        if wakes in ready:
            os.read(wakes, 4096)
            reap(statuses)
        if control not in ready:
            continue
        request, descriptors, _, _ = socket.recv_fds(control, LARGEST_REQUEST, 2)
        if not request:  # the tests were killed; their drivers might open ports of later tests
            for pid in statuses:
                os.kill(pid, signal.SIGTERM)
            return
        output, status = descriptors
        pid = os.fork()
        if pid == 0:
            control.close()
            for inherited in (wakes, wake, status, *statuses.values()):
                os.close(inherited)
            drive(*json.loads(request), output)
        os.close(output)
        statuses[pid] = status
        control.send(str(pid).encode())


def reap(statuses: dict[int, int]) -> None:
    """Write the exit code of each ended driver to its descriptor in ``statuses``."""
    while statuses:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if pid == 0:
            return
        descriptor = statuses.pop(pid)
        with contextlib.suppress(BrokenPipeError):
            os.write(descriptor, str(os.waitstatus_to_exitcode(status)).encode())
        os.close(descriptor)


def drive(arguments: list[str], environment: dict[str, str], before: str, output: int) -> NoReturn:
    """Run the driver in this forked process. End without the exit handlers of libraries.

    LTTng's handler would try to stop a thread that does not exist in a forked process.
    """
    from omnibot_driver import driver

    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for standard in (1, 2):
        os.dup2(output, standard)
    os.close(output)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = [driver.__file__, *arguments]
    code = 1
    try:
        exec(before, {"__name__": "before"})
        code = driver.main()
        for thread in threading.enumerate():
            if not thread.daemon and thread is not threading.main_thread():
                thread.join()
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code)
