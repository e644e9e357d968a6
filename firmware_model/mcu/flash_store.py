"""Non-volatile memory of a processor."""

from dataclasses import dataclass, field
from itertools import zip_longest


@dataclass(eq=False)
class FlashStore:
    """Flash pages by name, which survive power cycles, and the number of writes of each."""

    pages: dict[str, bytes] = field(default_factory=dict)
    writes: dict[str, int] = field(default_factory=dict)

    def write(self, page: str, data: bytes, endurance: int | None = None) -> None:
        """Erase and program ``page``; after ``endurance`` writes its zeros remain."""
        if endurance is not None and self.writes.get(page, 0) >= endurance:
            worn = self.pages.get(page, b"")
            data = bytes(old & new for old, new in zip_longest(worn, data, fillvalue=0xFF))
        self.pages[page] = bytes(data)
        self.writes[page] = self.writes.get(page, 0) + 1

    def erase(self, page: str) -> None:
        self.pages.pop(page, None)

    def read(self, page: str) -> bytes | None:
        """Contents of ``page``, or None if it is erased."""
        return self.pages.get(page)
