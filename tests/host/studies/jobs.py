"""What workers do in the tests; they import this module, and nothing that takes time."""

import os
import signal
from pathlib import Path


def square(number: int) -> int:
    return number * number


def own_process(_number: int) -> int:
    return os.getpid()


def die(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def die_once(job: tuple[Path, int]) -> int:
    mark, number = job
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def fail(number: int) -> int:
    raise ValueError(f"not {number}")
