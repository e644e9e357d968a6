"""Copies of this process: a checkpoint that has everything, made by ``fork``."""

import logging
import os
import pickle
import select
import signal
import time
from collections.abc import Callable
from typing import IO, TypeVar

T = TypeVar("T")

LIMIT_S = 60.0
"""Time-out of a copy in wall time: its work takes a second."""


class CopyError(RuntimeError):
    """A copy that failed, hangs or died."""


def in_copy(act: Callable[[], T], limit_s: float = LIMIT_S) -> T:
    """Result of ``act`` in a forked copy of this process, which continues from this state.

    The copy has everything: gateware, memories, virtual time, and the running firmware. It shares
    all unwritten memory, so it costs a few milliseconds.

    Raises CopyError with the copy's error, if it dies, and after ``limit_s`` of wall time.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _run(act, writing)
    os.close(writing)
    with open(reading, "rb", buffering=0) as pipe:
        try:
            answer = _read(pipe, time.monotonic() + limit_s)
        except TimeoutError:
            os.kill(child, signal.SIGKILL)
            raise CopyError(f"no end after {limit_s:g} s") from None
        finally:
            os.waitpid(child, 0)
    if not answer:
        raise CopyError("the copy of the process died")
    failed, result = pickle.loads(answer)  # from our own copy
    if failed:
        raise CopyError(result)
    return result  # type: ignore[no-any-return]


def _run(act: Callable[[], T], writing: int) -> None:
    """Runs in the copy and does not return. Its warnings are part of the answer."""
    logging.disable()
    try:
        try:
            answer = pickle.dumps((False, act()))
        except BaseException as error:  # reported to the parent
            answer = pickle.dumps((True, f"{type(error).__name__}: {error}"))
        with open(writing, "wb") as pipe:
            pipe.write(answer)
    finally:
        os._exit(0)


def _read(pipe: IO[bytes], until: float) -> bytes:
    parts = list[bytes]()
    while True:
        ready, _, _ = select.select([pipe], [], [], max(0.0, until - time.monotonic()))
        if not ready:
            raise TimeoutError
        part = pipe.read(1 << 20)
        if not part:
            return b"".join(parts)
        parts.append(part)
