"""Non-volatile memory of a processor."""


class FlashStore:
    """Flash pages by name: survives resets and power cycles.

    Attributes:
        pages: contents by page name.
        writes: how often each page was written, for the wear report.
    """

    def __init__(self) -> None:
        """Make an erased store."""
        self.pages: dict[str, bytes] = {}
        self.writes: dict[str, int] = {}

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
