"""`make fuzz`: every reader gets documents that are nearly right, for a chosen time.

A document is built by Hypothesis from valid ones and from values that are often wrong, then changed
further. Judged for each: no exception but a one-line ValueError or OSError, less than `LONGEST_S`
of processor time, and no file opened outside of the given folder; at the end, the memory. Documents
that fail are kept, by default in out/fuzz, and tried first the next time.
"""

import argparse
import random
import re
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.fuzz.readers import FILE, READERS, Reader

LONGEST_S = 2.0
MOST_MEMORY = 500 << 20
VARIANTS = 25
"""Documents that follow from one example of Hypothesis."""

ROOT = Path(__file__).parents[2]

WORDS = (
    *(b"nan", b"inf", b"-inf", b"NaN", b"-1", b"0", b"1e400", b"9" * 30, b"9" * 5000, b"null"),
    *(b"true", b'""', b"[]", b"{}", b"[" * 40, b"{" * 40, b"]" * 40, b"\0", b"\xff\xfe", b"\r\n"),
    *(b'"/etc/passwd"', b'"../x"', b'"\\ud800"', b"\x1b[31m", b"a." * 40, b"1979-05-27", b"#"),
    *(b"$", b"#00", b"}", b"\x03", b"\xff\xf0", b"\xff\xfa", b"=", b"[[", b"]]", b"'''", b'"""'),
)

NUMBERS = (
    *(b"0", b"1", b"-1", b"2", b"0.5", b"1e-9", b"-0.0", b"90", b"1000", b"65536", b"1e9", b"1e18"),
    *(b"9223372036854775807", b"-9223372036854775808", b"1e300", b"1e-300", b"0x7f", b'"a"'),
)
_TOKEN = re.compile(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?|\"[^\"\n]*\"|\btrue\b|\bfalse\b")

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["/etc/passwd", "/dev/zero", "..", "\ud800", "\x1b[31m"]),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)


class Watch:
    """Files that this process opens while a reader runs, apart from modules and our package."""

    def __init__(self) -> None:
        self.outside: list[str] = []
        self.folder = ""
        own = {ROOT, Path(sys.prefix), Path(sys.base_prefix), Path(st.__file__).parents[2]}
        self._own = tuple(f"{path.resolve()}/" for path in own)
        sys.addaudithook(self._audit)

    def _audit(self, name: str, arguments: tuple[object, ...]) -> None:
        if not self.folder or name not in ("open", "subprocess.Popen", "os.system"):
            return
        path = arguments[0]
        if isinstance(path, int):
            return
        text = str(Path(str(path)).absolute()) if name == "open" else f"{name} {path}"
        inside = text.startswith((self.folder, *self._own, "/proc/self/"))
        if not inside or ".." in Path(text).parts:
            self.outside.append(text)


def variants(document: bytes, chance: random.Random) -> Iterator[bytes]:
    """``document``, then what becomes of it by a few changes each."""
    yield document
    for _ in range(VARIANTS - 1):
        changed = bytearray(document)
        for _ in range(chance.choice((1, 1, 2, 4))):
            _change(changed, chance)
        yield bytes(changed)


def _change(document: bytearray, chance: random.Random) -> None:
    at = chance.randrange(len(document) + 1)
    end = min(len(document), at + chance.choice((1, 2, 4, 16, 64)))
    match chance.randrange(13):
        case 0 if document:
            document[at % len(document)] ^= 1 << chance.randrange(8)
        case 1:
            document[at:end] = b""
        case 2:
            document[at:at] = chance.choice(WORDS)
        case 3:
            document[at:end] = chance.choice(WORDS)
        case 4:
            document[at:at] = document[at:end] * chance.choice((1, 3, 200))
        case 5:
            del document[at:]
        case 6:
            document[at:end] = chance.randbytes(end - at)
        case 7 | 8:
            lines = document.splitlines(keepends=True)
            if lines:
                line = lines.pop(chance.randrange(len(lines)))
                lines[chance.randrange(len(lines) + 1) : 0] = [line] * chance.randrange(3)
            document[:] = b"".join(lines)
        case _:
            if tokens := [*_TOKEN.finditer(document)]:
                start, end = chance.choice(tokens).span()
                document[start:end] = chance.choice((*NUMBERS, document[start:end]))


def judged(
    name: str, reader: Reader, document: bytes, folder: Path, watch: Watch
) -> tuple[str, str | None]:
    """Outcome, and what is wrong with it."""
    for old in folder.iterdir():
        old.unlink()
    (folder / FILE).write_bytes(document)
    watch.outside.clear()
    begin_s = time.process_time()
    outcome, wrong = "accepted", None
    watch.folder = str(folder)
    try:
        reader.read(folder)
    except (ValueError, OSError) as error:
        outcome = "rejected"
        text = str(error)
        if not text.isprintable() or len(text) > 100_000:
            wrong = f"its error is no line of text: {text[:200]!r}"
    except BaseException:
        wrong = traceback.format_exc()
    finally:
        watch.folder = ""
    took_s = time.process_time() - begin_s
    if took_s > LONGEST_S:
        wrong = wrong or f"it took {took_s:.1f} s"
    if watch.outside:
        wrong = wrong or f"it opened {watch.outside}"
    return outcome, None if wrong is None else f"{name}: {wrong}"


class Fuzzer:
    """Tries documents and counts; what fails goes to ``seeds``."""

    def __init__(self, seeds: Path, folder: Path, tell: Callable[[str], None]) -> None:
        self.counts: Counter[tuple[str, str]] = Counter()
        self.failures: list[str] = []
        self._seeds, self._folder, self._tell = seeds, folder, tell
        self._watch = Watch()

    @property
    def tried(self) -> int:
        return sum(self.counts.values())

    def attempt(self, name: str, document: bytes) -> None:
        outcome, wrong = judged(name, READERS[name], document, self._folder, self._watch)
        self.counts[name, outcome] += 1
        if wrong is None:
            return
        self.failures.append(wrong)
        place = self._seeds / name.replace(" ", "-") / f"{hash(document) & 0xFFFFFFFF:08x}"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(document)
        self._tell(f"{place}: {wrong}")

    def repeat(self) -> None:
        """Try what failed before."""
        for name in READERS:
            for place in sorted(self._seeds.glob(f"{name.replace(' ', '-')}/*")):
                self.attempt(name, place.read_bytes())

    def run(self, name: str, until_s: float, seed: int) -> None:
        """Try a reader up to ``until_s`` of the monotonic clock."""
        documents = READERS[name].documents
        examples = st.sampled_from(documents) | VALUES.map(_as_text) | st.binary(max_size=60)

        @settings(
            max_examples=40,
            database=None,
            deadline=None,
            derandomize=False,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(st.data())
        def attempt_all(data: st.DataObject) -> None:
            document, other = data.draw(examples), data.draw(st.none() | st.sampled_from(documents))
            if time.monotonic() > until_s:
                return
            if other is not None:
                document = _spliced(document, other, chance)
            for one in variants(document, chance):
                self.attempt(name, one)

        chance = random.Random(seed)
        while time.monotonic() < until_s:
            attempt_all()


def _as_text(value: object) -> bytes:
    return repr(value).encode("utf-8", "surrogatepass")


def _spliced(one: bytes, other: bytes, chance: random.Random) -> bytes:
    at, there = chance.randrange(len(one) + 1), chance.randrange(len(other) + 1)
    return one[:at] + other[there:]


def _most_memory() -> int:
    """Largest use of memory by this program, in bytes; not what started it, as `getrusage` has."""
    (line,) = re.findall(r"^VmHWM:\s*(\d+) kB$", Path("/proc/self/status").read_text(), re.M)
    return int(line) << 10


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seeds", type=Path, default=Path("out/fuzz"))
    parser.add_argument("--seed", type=int, default=random.SystemRandom().getrandbits(32))
    parser.add_argument("readers", nargs="*", help=f"of: {', '.join(READERS)}")
    args = parser.parse_args(arguments)
    names = args.readers or [*READERS]
    with tempfile.TemporaryDirectory() as folder:
        fuzzer = Fuzzer(args.seeds, Path(folder).resolve(), print)
        fuzzer.repeat()
        for name in names:
            for document in READERS[name].documents:
                fuzzer.attempt(name, document)
        for number, name in enumerate(names):
            fuzzer.run(name, time.monotonic() + 60 * args.minutes / len(names), args.seed + number)
    memory = _most_memory()
    for name in names:
        accepted, rejected = (fuzzer.counts[name, one] for one in ("accepted", "rejected"))
        print(f"{name}: {accepted + rejected} documents, {rejected} rejected")
    print(f"{fuzzer.tried} documents, {memory >> 20} MB, {len(fuzzer.failures)} failures")
    return int(bool(fuzzer.failures) or memory > MOST_MEMORY)


if __name__ == "__main__":
    sys.exit(main())
