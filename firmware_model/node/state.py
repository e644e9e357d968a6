"""Error flags of a node, as one of its telemetry messages shows them."""

from collections.abc import Iterable

from cubestack.firmware_model.interface.codec.field import InterfaceError, suggestion


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
            raise InterfaceError(
                f"no error flag {name!r} in telemetry; {suggestion(name, sorted(self._declared))}"
            )
        self.flags.add(name)
