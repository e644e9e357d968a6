"""Non-volatile memory of a processor."""

from dataclasses import dataclass, field


@dataclass(eq=False)
class FlashStore:
    """Flash pages by name, which survive power cycles, and how often each was written."""

    pages: dict[str, bytes] = field(default_factory=dict)
    writes: dict[str, int] = field(default_factory=dict)

    def write(self, page: str, data: bytes) -> None:
        """Erase and program ``page``."""
        self.pages[page] = bytes(data)
        self.writes[page] = self.writes.get(page, 0) + 1

    def erase(self, page: str) -> None:
        """Erase ``page``; reading it then gives None."""
        self.pages.pop(page, None)

    def read(self, page: str) -> bytes | None:
        """Contents of ``page``, or None when it is erased."""
        return self.pages.get(page)
