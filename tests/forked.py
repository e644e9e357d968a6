"""`cubestack` in a fork of this process: its modules are loaded, which takes a new one longest.

Each kind of command has a test, too, that starts it as users do.
"""

import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, Self

import pytest

from cubestack.host.cli.main import main
from tests.conftest import Outcome

TIMEOUT_S = 120


class Forked:
    """A process that does ``call``; what it has of ``subprocess.Popen`` is the same.

    Its exit status is what ``call`` returns.
    """

    def __init__(
        self,
        call: Callable[[], object],
        *,
        folder: Path | None = None,
        environment: Mapping[str, str] | None = None,
        streams: Sequence[int | None] = (None, None, None),
    ) -> None:
        """``streams`` are its standard ones, None for those of this process."""
        self.returncode: int | None = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of threads: none of them is needed there
            self.pid = os.fork()
        if self.pid == 0:
            _become(call, folder, environment, streams)

    def poll(self) -> int | None:
        if self.returncode is None and os.waitid(
            os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT
        ):
            _, status = os.waitpid(self.pid, 0)
            self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float) -> int:
        """Raises subprocess.TimeoutExpired after that many seconds."""
        if self.poll() is None:
            ending = os.pidfd_open(self.pid)  # readable once the process has ended
            ended, _, _ = select.select([ending], [], [], timeout)
            os.close(ending)
            if not ended:
                raise subprocess.TimeoutExpired("a fork", timeout)
        code = self.poll()
        assert code is not None
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
        self.wait(60)


def command(*words: object) -> Callable[[], int]:
    """Does `cubestack` with ``words``."""
    return partial(main, [str(word) for word in words])


def of_pytest(*words: object) -> Callable[[], int]:
    """Does `pytest` with ``words``; the watch for tests that stand still has no thread there."""
    return lambda: pytest.main(["-p", "no:faulthandler", *(str(word) for word in words)])


def forked(
    call: Callable[[], object], *, given: str = "", timeout: float = TIMEOUT_S, **options: Any
) -> Outcome:
    """What a process prints that does ``call``, and its exit status; its input is ``given``."""
    with (
        tempfile.TemporaryFile("w+") as stdin,
        tempfile.TemporaryFile("w+") as stdout,
        tempfile.TemporaryFile("w+") as stderr,
    ):
        stdin.write(given)
        stdin.seek(0)
        streams = [one.fileno() for one in (stdin, stdout, stderr)]
        with Forked(call, streams=streams, **options) as process:
            code = process.wait(timeout)
        stdout.seek(0)
        stderr.seek(0)
        return Outcome(code, stdout.read(), stderr.read())


class Served:
    """A process of `cubestack emulate`, as a context manager; ``said`` is its output so far.

    At its end that is all of it.
    """

    def __init__(self, words: Sequence[object], folder: Path, *, last: str = " serves on ") -> None:
        """Starts it in ``folder`` and waits until it prints ``last``."""
        reading, writing = os.pipe()
        self.process = Forked(
            command("emulate", *words),
            folder=folder,
            environment=os.environ | {"COLUMNS": "200"},  # its message on one line
            streams=(None, None, writing),
        )
        os.close(writing)
        self._stderr = open(reading)  # noqa: SIM115 - closed at the end
        self.said = ""
        self._rest = threading.Thread(target=self._read_on)
        watch = threading.Timer(TIMEOUT_S, self.process.kill)
        watch.start()
        for line in self._stderr:
            self.said += line
            if last in line:
                break
        watch.cancel()
        self._rest.start()
        if last not in self.said:
            self.__exit__()
        assert last in self.said, self.said

    def _read_on(self) -> None:
        self.said += self._stderr.read()

    @property
    def port(self) -> str:
        return self.said.split(" serves on ")[1].split()[0]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self._rest.join()
        self._stderr.close()
        with self.process:
            self.process.wait(TIMEOUT_S)


def _become(
    call: Callable[[], object],
    folder: Path | None,
    environment: Mapping[str, str] | None,
    streams: Sequence[int | None],
) -> NoReturn:
    """What a process does that has just been forked."""
    code: Any = 1
    try:
        for number, own in enumerate(streams):
            if own is not None:
                os.dup2(own, number)
        sys.stdin = open(0, closefd=False)  # noqa: SIM115
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115
        signal.signal(signal.SIGINT, signal.default_int_handler)
        warnings.resetwarnings()
        warnings.simplefilter("ignore")
        os.chdir(folder or ".")
        if environment is not None:
            os.environ.clear()
            os.environ.update(environment)
        code = call()
    except SystemExit as end:
        code = end.code
        if isinstance(code, str):
            print(code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else int(code is not None))
