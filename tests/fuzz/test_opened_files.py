"""What the kernel saw the fuzzed readers open, libraries in C included."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

#: Folders of programs and of the documents, and what the loader, Python and NumPy read.
OWN = (
    *(ROOT, Path(sys.prefix), Path(sys.base_prefix), Path(tempfile.gettempdir())),
    *(Path(one) for one in sys.path if one),
    *(Path(one) for one in ("/usr", "/lib", "/lib64", "/etc/ld.so.cache", "/sys/devices/system")),
    *(Path(one) for one in ("/proc/self", "/proc/meminfo", "/proc/cpuinfo", "/dev/null")),
    *(Path("/dev/urandom"), Path("/etc/localtime")),
)
CALL = re.compile(r'(\w+)\((?:AT_FDCWD, )?(?:\{[^}]*\}|"((?:[^"\\]|\\.)*)").*\) = (-?\d+)')


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
def test_readers_open_nothing_outside_of_the_given_folder(tmp_path: Path) -> None:
    log, seeds = tmp_path / "calls", tmp_path / "seeds"
    traced = ("open", "openat", "openat2", "creat", "execve", "connect", "unlink", "rename")
    strace = ["strace", "-f", "-qq", "--seccomp-bpf", "-s", "4096", "-o", str(log)]
    fuzz = [sys.executable, "-m", "tests.fuzz.run", "--minutes", "0.1", "--seeds", str(seeds)]
    command = [*strace, "-e", f"trace={','.join(traced)}", *fuzz]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=250)
    if "ptrace" in done.stderr.lower():
        pytest.skip(f"strace may not trace here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    found = [
        (call, ROOT / path, int(result))
        for call, path, result in CALL.findall(log.read_text(errors="replace"))
    ]
    assert len(found) > 1000
    inside = tuple(f"{path.resolve()}/" for path in OWN) + tuple(f"{path}/" for path in OWN)
    outside = {
        (call, str(path))
        for call, path, result in found
        if result >= 0 and not f"{os.path.normpath(path)}/".startswith(inside)
    }
    assert not outside
    started = [path for call, path, result in found if call == "execve" and result == 0]
    assert started == [Path(sys.executable)]
    assert not any(call == "connect" for call, _, _ in found)
