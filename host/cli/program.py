"""The terminal of a program that uses semihosting: its console input and its exit status."""

import os
import select
import sys

LARGEST_STATUS = 0xFF


def read_console(count: int) -> bytes | None:
    """Up to ``count`` bytes of standard input; b"" at its end.

    On a terminal None while nothing is typed; a pipe without data counts as ended.
    """
    try:
        stdin = sys.stdin.fileno()
        interactive = os.isatty(stdin)
        if interactive and _in_background(stdin):
            return b""  # reading would stop this process
        if select.select([stdin], [], [], 0)[0]:
            return os.read(stdin, count)
    except (AttributeError, OSError, ValueError):  # there is no standard input
        return b""
    return None if interactive else b""


def _in_background(terminal: int) -> bool:
    try:
        return os.tcgetpgrp(terminal) != os.getpgrp()
    except OSError:  # not the controlling terminal
        return False


def exit_status(status: int) -> int:
    """Exit status of a command for a program's; success only for success."""
    return status & LARGEST_STATUS or int(status != 0)
