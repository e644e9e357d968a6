"""An independent reader of VCD files."""

from collections import defaultdict
from typing import Any, BinaryIO

from vcd.reader import TokenKind, tokenize

Changes = dict[str, list[tuple[int, Any]]]


def read(stream: BinaryIO) -> Changes:
    """Changes (ns, value) of each variable by its dotted name without the device's."""
    names: dict[str, str] = {}
    scope: list[str] = []
    time_ns = 0
    changes: Changes = defaultdict(list)
    for token in tokenize(stream):
        match token.kind:
            case TokenKind.SCOPE:
                scope.append(token.scope.ident)
            case TokenKind.UPSCOPE:
                scope.pop()
            case TokenKind.VAR:
                names[token.var.id_code] = ".".join([*scope[1:], token.var.reference])
            case TokenKind.CHANGE_TIME:
                assert token.time_change >= time_ns
                time_ns = token.time_change
            case TokenKind.CHANGE_SCALAR | TokenKind.CHANGE_VECTOR | TokenKind.CHANGE_STRING:
                change: Any = token.data
                value = change.value
                plain = int(value) if isinstance(value, str) and value in ("0", "1") else value
                changes[names[change.id_code]].append((time_ns, plain))
    return changes
