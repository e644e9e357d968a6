"""Mutants of Python modules: one expression or statement changed, as a slip would change it."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PARTS = ("firmware_model", "emulator", "host")

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
SIGNS: dict[type[ast.operator], type[ast.operator]] = {ast.Add: ast.Sub, ast.Sub: ast.Add}


@dataclass(frozen=True)
class Mutant:
    """``path`` is relative to the project; bytes ``first`` to ``last`` of it are changed.

    They stand in the lines ``line`` to ``end``, of a statement that begins in line ``statement``.
    """

    path: Path
    statement: int
    line: int
    end: int
    first: int
    last: int
    before: str
    after: str

    def put_into(self, text: str) -> str:
        """The ``text`` of the module with the mutant."""
        code = text.encode()
        return (code[: self.first] + self.after.encode() + code[self.last :]).decode()

    def __str__(self) -> str:
        before, after = (" ".join(part.split())[:60] for part in (self.before, self.after))
        return f"{self.path}:{self.line}: {before} -> {after}"


def modules(root: Path) -> list[Path]:
    """Modules of the three parts, relative to ``root``, sorted."""
    found = (path for part in PARTS for path in (root / part).rglob("*.py"))
    return sorted(path.relative_to(root) for path in found)


def mutants(path: Path, text: str) -> list[Mutant]:
    """All mutants of a module, by line; raises if the module does not parse."""
    starts = [0]
    for line in text.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    code, found = text.encode(), []
    for statement, node, after in _changes(ast.parse(text)):
        line, end = node.lineno, node.end_lineno or 0
        first = starts[line - 1] + node.col_offset
        last = starts[end - 1] + (node.end_col_offset or 0)
        before = code[first:last].decode()
        found.append(Mutant(path, statement, line, end, first, last, before, after))
    return sorted(found, key=lambda mutant: mutant.line)


def _changes(tree: ast.AST) -> Iterator[tuple[int, ast.expr | ast.stmt, str]]:
    """(first lines of their statements, nodes, replacements)."""
    same_as_pass = {id(node.body[-1]) for node in ast.walk(tree) if isinstance(node, FUNCTIONS)}
    for statement, node in _nodes(tree):
        match node:
            case ast.Compare(left, [operator], [right]) if type(operator) in COMPARISONS:
                other = COMPARISONS[type(operator)]()
                yield statement, node, f"({ast.unparse(ast.Compare(left, [other], [right]))})"
            case ast.BinOp(left, operator, right) if type(operator) in SIGNS:
                other_sign = SIGNS[type(operator)]()
                yield statement, node, f"({ast.unparse(ast.BinOp(left, other_sign, right))})"
            case ast.AugAssign(target, operator, value) if type(operator) in SIGNS:
                yield (
                    statement,
                    node,
                    ast.unparse(ast.AugAssign(target, SIGNS[type(operator)](), value)),
                )
            case ast.Constant(value) if isinstance(value, int | float) and value is not True:
                if value is not False:
                    yield statement, node, f"({value + 1!r})"
            case ast.Expr(ast.Call() | ast.Yield() | ast.YieldFrom()) | ast.Raise():
                yield statement, node, "pass"
            case ast.Return(ast.Constant(None)) if id(node) in same_as_pass:
                pass
            case ast.Return(value) if value is not None:
                yield statement, node, "pass"
        if isinstance(node, ast.If | ast.While | ast.IfExp):
            yield statement, node.test, f"(not ({ast.unparse(node.test)}))"


def _nodes(tree: ast.AST, statement: int = 0) -> Iterator[tuple[int, ast.AST]]:
    """All but annotations, f-strings, whose parts have no places, what only types need, as
    functions without a body of protocols, and colours, which nobody tells from those beside
    them."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns") or isinstance(tree, ast.JoinedStr):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue
            if isinstance(child, FUNCTIONS) and all(_says_only(line) for line in child.body):
                continue
            if isinstance(child, ast.AST) and not _is_colour(child):
                begins = child.lineno if isinstance(child, ast.stmt) else statement
                yield begins, child
                yield from _nodes(child, begins)


def _says_only(statement: ast.stmt) -> bool:
    """Whether it is a text or an ellipsis."""
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _is_colour(node: ast.AST) -> bool:
    """Whether it is a colour of three values up to 255."""
    match node:
        case ast.Tuple([ast.Constant(red), ast.Constant(green), ast.Constant(blue)]):
            shares = red, green, blue
            return all(isinstance(share, int) and 10 <= share <= 255 for share in shares)
    return False
