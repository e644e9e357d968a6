"""A process of `cubestack emulate` that ends with whoever wants it, by whichever way."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Thread

ENDING_S = 10.0
"""Wall time that a process has to end when it is asked to."""


@contextmanager
def emulating(
    words: Sequence[str], environment: Mapping[str, str] | None = None
) -> Iterator[Iterator[str]]:
    """Run `cubestack emulate` with ``words`` as long as the block lasts.

    Yields what it says, line by line, to its end. It ends when this process does, even if that is
    killed.
    """
    theirs, ours = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-m", "cubestack", "emulate", *words, "--lifeline", str(theirs)],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        pass_fds=[theirs],
        env={**os.environ, **(environment or {})},
    )
    os.close(theirs)
    said = SimpleQueue[str | None]()

    def listen() -> None:  # what it says must not fill the pipe, whoever asks for it
        assert process.stderr is not None
        with process.stderr:
            for line in process.stderr:
                said.put(line.strip())
        said.put(None)

    listener = Thread(target=listen, daemon=True)
    listener.start()
    try:
        yield iter(said.get, None)
    finally:
        os.close(ours)
        process.terminate()
        try:
            process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        listener.join(ENDING_S)
