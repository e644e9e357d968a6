"""A `cubestack emulate` process that ends with its parent, however that ends."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Thread

ENDING_S = 10.0
"""Wall time for a process to end on request."""


@contextmanager
def emulating(
    words: Sequence[str], environment: Mapping[str, str] | None = None
) -> Iterator[Iterator[str]]:
    """Run `cubestack emulate` with ``words`` for the duration of the block.

    Yields its output line by line. It ends with this process, even if that is killed.
    """
    theirs, ours = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "cubestack", "emulate", *words, "--lifeline", str(theirs)],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        pass_fds=[theirs],
        env={**os.environ, **(environment or {})},
    )
    os.close(theirs)
    said = SimpleQueue[str | None]()

    def listen() -> None:  # its output must not fill the pipe when nobody reads it
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
