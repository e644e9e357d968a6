"""What runs and what is read during a measurement."""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import CodeType, FrameType
from typing import Any

from cubestack.host.studies.rows.sources import ROOT, Name, entries, relative

#: Of the studies, what only runs trials and stores what they return.
_MACHINERY = (
    "host/studies/fidelity/",
    *(f"host/studies/rows/{name}.py" for name in ("record", "sources", "trace")),
    "host/studies/workers.py",
)

#: Files of the project that this process has opened, but for Python's.
_opened = set[str]()


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and isinstance(arguments[0], str):
        file = relative(arguments[0])
        if file is not None and not file.endswith((".py", ".pyc", ".md")):
            _opened.add(file)


class Trace:
    """Code that ran, but for that of imports: of their results, those count that the code uses."""

    def __init__(self) -> None:
        self._begun = time.time()
        self._codes = set[CodeType]()
        self._importing = 0  # modules, one inside the other

    def _note(self, frame: FrameType, event: str, _argument: object) -> None:
        code = frame.f_code
        if code.co_name == "<module>":
            self._importing += (event == "call") - (event == "return")
        elif event == "call" and not self._importing:
            self._codes.add(code)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Note what runs meanwhile; slows it by a factor of two to three."""
        threading.setprofile(self._note)
        sys.setprofile(self._note)
        try:
            yield
        finally:
            sys.setprofile(None)
            threading.setprofile(None)

    def noted(self) -> "Noted":
        ran = set[Name]()
        for code in self._codes:
            file = relative(code.co_filename)
            if file is not None and not file.startswith(_MACHINERY):
                ran.add((file, code.co_qualname.partition(".<locals>")[0]))
        return Noted(frozenset(ran), frozenset(_opened), self._begun)


@dataclass(frozen=True)
class Noted:
    """What ran and was read in a process; another one may look up what that depends on."""

    ran: frozenset[Name]
    files: frozenset[str]
    begun: float  #: time of the start

    def entries(self) -> list[str]:
        """Entries of what the measurement depends on; RuntimeError if a file has changed since."""
        found = entries(self.ran, self.files)
        for file in {one.partition(":")[0] for one in found}:
            if (ROOT / file).stat().st_mtime > self.begun:
                raise RuntimeError(f"{file} has changed while it was in use; measure again")
        return found


sys.addaudithook(_audit)
