"""An emulator in a process of its own, for commands that show what a user would do."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cubestack.host.cli.terminal import say
from cubestack.host.errors import PortClosedError, PortOpenError

__all__ = ["served"]

BOOT_TIMEOUT_S = 120.0  # the first start compiles the FPGA


@contextmanager
def served(device: str, scene: Path, port: Path) -> Iterator[Path]:
    """An emulator process that serves ``device``, which sees ``scene``, on ``port``."""
    command = [sys.executable, "-m", "cubestack.host.cli.main", "emulate", device]
    command += ["--scene", str(scene), "--pty", str(port), "--pace", "fast"]
    say("starting the emulator; its first start on a machine compiles what it needs")
    emulator = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert emulator.stderr is not None
        line = emulator.stderr.readline().strip()
        if not port.exists():
            raise PortOpenError(line or "the emulator did not start")
        say(line)
        yield port
    except PortClosedError:
        emulator.kill()
        say(f"the emulator ended: {emulator.communicate()[1].strip().splitlines()[-1]}")
        raise
    finally:
        emulator.terminate()
        emulator.communicate(timeout=BOOT_TIMEOUT_S)
