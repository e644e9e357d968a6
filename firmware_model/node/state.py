"""Error flags of a node, as one of its telemetry messages shows them."""

from collections.abc import Iterable


class NodeState:
    """RAM that every node's program has: ``flags``, the names of the raised ones."""

    def __init__(self, declared: Iterable[str]) -> None:
        self._declared = frozenset(declared)
        self.flags: set[str] = set()

    def flag_values(self) -> dict[str, bool]:
        return {name: name in self.flags for name in self._declared}

    def raise_flag(self, name: str) -> None:
        """Raise an error flag; KeyError if telemetry does not declare it."""
        if name not in self._declared:
            raise KeyError(f"telemetry declares no flag {name!r}")
        self.flags.add(name)
