"""Start of the command: Ctrl-C ends it with status 130, also while its modules are loaded.

The script ``cubestack`` beside this file blocks the signal until then. With ``python -m cubestack``
Ctrl-C prints a traceback while the interpreter starts.
"""

import os
import signal
import sys
from types import FrameType

INTERRUPTED = 128 + signal.SIGINT
AGAIN_S = 0.01


def main() -> int:
    """Run the process's own command line; returns the exit status."""
    before = signal.getsignal(signal.SIGINT)
    ignored = before is not signal.default_int_handler
    if not ignored:
        signal.signal(signal.SIGINT, _end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # the script has blocked it
    if ignored:
        from cubestack.host.cli.main import main as run

        return run()
    sys.unraisablehook = deliver_again
    asked = Asked()
    try:
        from cubestack.host.cli.main import main as run

        status = run(on_start=lambda: signal.signal(signal.SIGINT, asked.interrupt))
        return INTERRUPTED if status and asked.once else status
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception:
        if asked.once:
            return INTERRUPTED
        raise
    finally:
        signal.signal(signal.SIGINT, _end)  # a second one while the interpreter ends


class Asked:
    """Whether Ctrl-C came: Python hides it behind another error where it comes while a module's
    classes are made (``type.__new__`` raises RuntimeError for any error in ``__set_name__``)."""

    def __init__(self) -> None:
        self.once = False

    def interrupt(self, _number: int, _frame: FrameType | None) -> None:
        self.once = True
        raise KeyboardInterrupt


def deliver_again(lost: "sys.UnraisableHookArgs") -> None:
    """Send Ctrl-C again if it came where exceptions are ignored, as in ``__del__``."""
    if lost.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(lost)
        return
    from threading import Timer

    Timer(AGAIN_S, os.kill, (os.getpid(), signal.SIGINT)).start()


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
