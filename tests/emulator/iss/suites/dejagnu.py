"""Runs test suites of Debian packages on the emulated part, by DejaGnu, as their authors do."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.emulator.iss.cross_compiler import COMPILER, compile_for_m3

from .results import Results, read_results

HERE = Path(__file__).parent
BOARD = "efm32gg"
OPTIONS = ("-O0", "-O2", "-Os")
"""Of the compiler, for each torture program."""

START_S = 120


@dataclass(frozen=True)
class Suite:
    """A suite in an archive of a package.

    Attributes:
        archives: pattern of the archive's path.
        folder: of the suite in the archive; ``members`` are the parts of it that are needed.
        tool: DejaGnu's name of what is tested.
        tests: files of tests to run; none stands for all.
    """

    package: str
    archives: str
    folder: str
    members: tuple[str, ...]
    tool: str
    tests: tuple[str, ...] = ()

    def archive(self) -> Path | None:
        """The archive, if the package is installed."""
        return next(iter(sorted(Path("/").glob(self.archives))), None)

    def unpack(self, place: Path) -> Path:
        """Extract what is needed; returns the suite's folder."""
        archive = self.archive()
        assert archive is not None
        patterns = [f"*{self.folder}/{member}" for member in self.members]
        command: list[str | Path] = ["tar", "-xf", archive, "-C", place, "--wildcards", *patterns]
        subprocess.run(command, check=True)
        return next(found for found in place.rglob("testsuite") if str(found).endswith(self.folder))


NEWLIB = Suite(
    "newlib-source", "usr/src/newlib/newlib-*.tar.xz", "newlib/testsuite", ("*",), "newlib"
)
GCC = Suite(
    "gcc-arm-none-eabi-source",
    "usr/src/gcc-arm-none-eabi-source.tar.xz",
    "gcc/testsuite",
    ("lib/*", "config/*", "gcc.c-torture/execute/*", "gcc.dg/fixed-point/*", "gcc.dg/*.h"),
    "gcc",
    ("execute.exp", "ieee.exp", "builtins.exp", "fixed-point.exp"),
)


@contextmanager
def running_service(folder: Path) -> Iterator[dict[str, str]]:
    """Serve runs of programs; yields the environment that `efm32gg.exp` needs."""
    start, smallest, place = folder / "start.o", folder / "smallest.elf", folder / "service"
    compile_for_m3("-O1", "-c", HERE / "start.c", "-o", start)
    source = folder / "smallest.c"
    source.write_text("int main(void) { return 0; }\n")
    compile_for_m3("--specs=rdimon.specs", start, source, f"-T{HERE}/part.ld", "-o", smallest)
    command: list[str | Path] = [
        sys.executable,
        "-m",
        f"{__package__}.program_service",
        place,
        smallest,
    ]
    with subprocess.Popen(command) as service:
        try:
            _wait_for(place, service)
            yield {"SUITES": str(HERE), "START": str(start), "SERVICE": str(place)}
        finally:
            service.terminate()


def _wait_for(place: Path, service: "subprocess.Popen[bytes]") -> None:
    end = time.monotonic() + START_S
    while not place.exists():
        if service.poll() is not None or time.monotonic() > end:
            raise RuntimeError("the service of programs did not start")
        time.sleep(0.02)


def run_suite(
    suite: Suite, sources: Path, folder: Path, environment: dict[str, str], *, every: int, seed: int
) -> Results:
    """Run one in ``every`` test files in parallel processes, and count how they ended."""
    (folder / "claimed").mkdir(parents=True)
    environment = {
        **os.environ,
        **environment,
        "PYTHON": sys.executable,
        "EVERY": str(every),
        "SEED": str(seed),
        "GCC_RUNTEST_PARALLELIZE_DIR": str(folder / "claimed"),
    }
    jobs = (os.cpu_count() or 1) if suite is GCC else 1
    running = [_start(suite, sources, folder / str(job), environment) for job in range(jobs)]
    for process in running:
        process.wait()
    total = Results()
    for job in range(jobs):
        one = read_results(folder / str(job) / f"{suite.tool}.log", sources)
        total.passed += one.passed
        total.misfits += one.misfits
        total.failed += one.failed
    return total


def _start(
    suite: Suite, sources: Path, folder: Path, environment: dict[str, str]
) -> "subprocess.Popen[bytes]":
    folder.mkdir()
    options = " ".join(f"{{ {option} }}" for option in OPTIONS)
    settings = {
        "boards_dir": HERE,
        "target_triplet": "arm-none-eabi",
        "target_alias": "arm-none-eabi",
        "host_triplet": "x86_64-pc-linux-gnu",
        "build_triplet": "x86_64-pc-linux-gnu",
        "tmpdir": folder,
        "objdir": folder,
        "srcdir": sources,
        "tool_version": "installed",
        "TORTURE_OPTIONS": options,
    }
    lines = [f"set {name} {{{value}}}" for name, value in settings.items()]
    (folder / "site.exp").write_text("\n".join(lines) + "\n")
    target = ["--target", "arm-none-eabi", f"--target_board={BOARD}"]
    command: list[str | Path] = [
        "runtest",
        "--tool",
        suite.tool,
        "--srcdir",
        sources,
        *target,
        *suite.tests,
    ]
    if suite is GCC:
        command.append(f"GCC_UNDER_TEST={COMPILER}")
    with (folder / "output").open("wb") as output:
        return subprocess.Popen(command, cwd=folder, env=environment, stdout=output, stderr=output)
