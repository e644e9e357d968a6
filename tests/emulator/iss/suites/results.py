"""What DejaGnu's log says of each program that was built and run."""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

RESULT = re.compile(r"(PASS|FAIL|UNSUPPORTED|UNRESOLVED|XPASS|XFAIL|ERROR|WARNING): (.*)")
RAN = re.compile(r"(execution( test)?|output)\b")
"""The words of results of a run; others are of the compiler."""

DECLARED_NEEDS = re.compile(r"dg-require-(?:effective-target\s+\"?)?([\w-]+)")
STACK = "the stack is larger than RAM"
MEMORY = re.compile(r"region .*(overflowed|is full)|will not fit in region")
LIBRARY = re.compile(
    r"undefined reference to|fatal error: .*: No such file|Failed to set .* locale"
)


@dataclass
class Results:
    """Programs by how they ended.

    Attributes:
        passed: programs that ran as they should.
        misfits: number of those that do not fit the part or the installed library, by reason.
        failed: names of the others, with DejaGnu's word.
    """

    passed: int = 0
    misfits: Counter[str] = field(default_factory=Counter)
    failed: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        misfits, failed = self.misfits.total(), len(self.failed)
        lines = [f"{self.passed} passed, {misfits} do not fit, {failed} failed"]
        lines += [f"  does not fit: {count} {why}" for why, count in self.misfits.most_common()]
        return "\n".join(lines + [f"  failed: {name}" for name in self.failed])


def read_results(log: Path, sources: Path) -> Results:
    """Count what a log has; ``sources`` is the folder that its names are relative to."""
    found = Results()
    for word, name, before in _entries(log.read_text(errors="replace")):
        if word == "PASS":
            found.passed += bool(RAN.search(name))
        elif word == "UNSUPPORTED":
            found.misfits[_declared_need(sources / name.split()[0], before)] += 1
        elif word == "FAIL" and STACK in before:
            found.misfits["needs a stack larger than RAM"] += 1
        elif word == "FAIL" and MEMORY.search(before):
            found.misfits["needs more memory than the part has"] += 1
        elif word == "FAIL" and LIBRARY.search(before):
            found.misfits["needs what the installed library lacks"] += 1
        elif word in ("FAIL", "ERROR"):
            found.failed.append(f"{word} {name}")
        # UNRESOLVED follows a failed compilation, which is counted; XFAIL is as it should be.
    return found


def _entries(log: str) -> Iterator[tuple[str, str, str]]:
    """Each result's word and name, and what the log has between the last result and it."""
    before: list[str] = []
    for line in log.splitlines():
        if match := RESULT.fullmatch(line):
            yield match[1], match[2], "\n".join(before)
            before = []
        else:
            before.append(line)


def _declared_need(source: Path, before: str) -> str:
    if MEMORY.search(before):
        return "needs more memory than the part has"
    needs = DECLARED_NEEDS.findall(source.read_text(errors="replace"))
    if not needs:
        return "declares not to be for Arm"
    return f"declares that it needs {' and '.join(needs)}"
