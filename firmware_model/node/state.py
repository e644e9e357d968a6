"""Error flags of a node, as one of its telemetry messages shows them."""

from collections.abc import Iterable


class NodeState:
    """What the RAM of every node's program holds: ``flags``, the names of the raised ones."""

    def __init__(self, declared: Iterable[str]) -> None:
        """Start with none of the ``declared`` flags raised."""
        self._declared = frozenset(declared)
        self.flags: set[str] = set()

    def flag_values(self) -> dict[str, bool]:
        """Every declared flag by its name: whether it is raised."""
        return {name: name in self.flags for name in self._declared}

    def raise_flag(self, name: str) -> None:
        """Raise an error flag; a name that the table lacks is a programming error."""
        if name not in self._declared:
            raise KeyError(f"telemetry declares no flag {name!r}")
        self.flags.add(name)
