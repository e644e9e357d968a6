"""Digests of source text: of data files, and of the statements that define some names.

Comments, docstrings and layout do not count. Digests do not depend on the version of Python.
"""

import ast
from collections.abc import Container, Iterable, Iterator
from functools import cache
from hashlib import blake2b
from pathlib import Path

import cubestack.firmware_model

ROOT = Path(next(iter(cubestack.firmware_model.__path__))).parent
"""Of the project's four packages."""

_PACKAGES = ("hdl", "firmware_model", "emulator", "host")
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_UNSEEN = {"ctx", "kind", "type_comment", "returns", "annotation"}
_SIZE = 5  # bytes of a digest

Name = tuple[str, str]
"""A file, relative to ``ROOT``, and a name that it defines, such as ``Class.method``."""


def relative(file: str | Path) -> str | None:
    """A file of the project relative to ``ROOT``; None for others."""
    path = Path(file)
    if not path.is_relative_to(ROOT):
        return None
    own = path.relative_to(ROOT)
    return own.as_posix() if own.parts[0] in _PACKAGES else None


def module_file(module: str) -> str | None:
    """The file of a module of the project."""
    parts = module.split(".")
    if parts[0] != "cubestack" or len(parts) < 2 or parts[1] not in _PACKAGES:
        return None
    path = "/".join(parts[1:])
    found = (f"{path}.py", f"{path}/__init__.py")
    return next((file for file in found if (ROOT / file).is_file()), None)


class Source:
    """A module's definitions and imports."""

    def __init__(self, file: str) -> None:
        #: statements that define a name; those of methods are named like ``Class.method``
        self.defined: dict[str, list[ast.stmt]] = {}
        #: module and name of what is imported from the project, anywhere in the module
        self.imported: dict[str, tuple[str, str]] = {}
        tree = ast.parse((ROOT / file).read_bytes())
        self._define(tree.body, "")
        for node in _walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                for alias in node.names:
                    self.imported[alias.asname or alias.name] = (node.module, alias.name)

    def _define(self, body: list[ast.stmt], prefix: str) -> None:
        for statement in body:
            inner = not prefix or isinstance(statement, (*_FUNCTIONS, ast.ClassDef))
            for name in _bound(statement) if inner else ():
                self.defined.setdefault(prefix + name, []).append(statement)
            if isinstance(statement, ast.ClassDef):
                self._define(statement.body, f"{prefix}{statement.name}.")

    def is_function(self, name: str) -> bool:
        return isinstance(self.defined[name][0], _FUNCTIONS)

    def digest(self, names: Iterable[str]) -> str:
        """Of the statements that define these names; classes without their methods."""
        hashed = blake2b(digest_size=_SIZE)
        for name in names:
            for statement in self.defined.get(name, ()):
                _feed(hashed, statement)
        return hashed.hexdigest()


@cache
def source(file: str) -> Source:
    return Source(file)


@cache
def digest(entry: str) -> str:
    """Of an entry: a data file; or a module, a colon, and names that it defines, with commas.

    Empty if the file is not there.
    """
    file, _, names = entry.partition(":")
    if not (ROOT / file).is_file():
        return ""
    if names:
        return source(file).digest(names.split(","))
    return blake2b((ROOT / file).read_bytes(), digest_size=_SIZE).hexdigest()


def entries(ran: Iterable[Name], files: Iterable[str]) -> list[str]:
    """Entries of all that a measurement depends on.

    Args:
        ran: functions that ran; those within a function count with it.
        files: data files and sources of other languages that were read.
    """
    own = {(file, name) for file, name in ran if name in source(file).defined}
    todo, reached = list(own), set[Name]()
    while todo:
        each = todo.pop()
        if each not in reached:
            reached.add(each)
            todo += _uses(each, ran=each in own)
    by_file: dict[str, set[str]] = {}
    for file, name in reached:
        by_file.setdefault(file, set()).add(name)
    sliced = [f"{file}:{','.join(sorted(names))}" for file, names in by_file.items()]
    return sorted([*sliced, *(file for file in files if _counts(file, by_file))])


def _counts(file: str, modules: Container[str]) -> bool:
    """Sources in C++ beside a module that was not used were only built with the others."""
    beside = Path(file).with_suffix(".py").as_posix()
    return beside in modules or not (ROOT / beside).is_file()


def _declaration(module: str, name: str, *, functions: bool) -> Iterator[Name]:
    """Where a name is defined, through re-exports; functions only if they are wanted."""
    for _ in range(8):
        file = module_file(module)
        if file is None:
            return
        own = source(file)
        if name in own.defined:
            if functions or not own.is_function(name):
                yield file, name
            return
        if name not in own.imported:
            return
        module, name = own.imported[name]


def _uses(each: Name, *, ran: bool) -> Iterator[Name]:
    """Definitions that the statements of a name use.

    A function that ran uses no other functions: those ran as well, or were not called. What defines
    a constant was executed by an import, with the functions that it calls. A function that reads
    the source of a module, for the name of a file in the cache, uses all that the module defines.
    """
    file, name = each
    own = source(file)
    holder = name.rpartition(".")[0]
    if holder:
        yield file, holder
    for statement in own.defined[name]:
        for node in _walk(statement, methods=isinstance(statement, _FUNCTIONS)):
            whole = _whole_module(own, node, file) if ran else None
            if whole is not None:
                yield from ((whole, each) for each in source(whole).defined)
            elif isinstance(node, ast.Name) and node.id in own.defined:
                if not (ran and own.is_function(node.id)):
                    yield file, node.id
            elif isinstance(node, ast.Name) and node.id in own.imported:
                yield from _declaration(*own.imported[node.id], functions=not ran)
            else:
                yield from _attribute(own, node, functions=not ran)


def _attribute(own: Source, node: ast.AST, *, functions: bool) -> Iterator[Name]:
    """Where the name of an imported module's attribute is defined."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        imported = own.imported.get(node.value.id)
        if imported is not None:
            yield from _declaration(".".join(imported), node.attr, functions=functions)


def _whole_module(own: Source, node: ast.AST, file: str) -> str | None:
    """The module whose ``__file__`` this is."""
    if isinstance(node, ast.Name) and node.id == "__file__":
        return file
    if not (isinstance(node, ast.Attribute) and node.attr == "__file__"):
        return None
    imported = own.imported.get(node.value.id) if isinstance(node.value, ast.Name) else None
    return module_file(".".join(imported)) if imported else None


def _walk(node: ast.AST, *, methods: bool = True) -> Iterator[ast.AST]:
    """Nodes that run: no annotations, nothing for type checkers, methods if wanted."""
    for field, value in ast.iter_fields(node):
        if field in _UNSEEN:
            continue
        for child in value if isinstance(value, list) else (value,):
            if not isinstance(child, ast.AST) or _is_for_types(child):
                continue
            yield child
            if methods or not isinstance(child, _FUNCTIONS):
                yield from _walk(child, methods=methods)


def _is_for_types(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    )


def _bound(node: ast.AST) -> Iterator[str]:
    """Names that a statement binds; those within functions, classes and comprehensions are not."""
    if isinstance(node, (*_FUNCTIONS, ast.ClassDef)):
        yield node.name
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    else:
        # ``:=`` in a condition of a comprehension binds outside of it.
        inner = node.ifs if isinstance(node, ast.comprehension) else ast.iter_child_nodes(node)
        for child in inner:
            yield from _bound(child)


def _feed(hashed: blake2b, value: object) -> None:
    """Add a node in a form that all versions of Python agree on."""
    if isinstance(value, list):
        for one in value:
            if not _is_text(one):
                _feed(hashed, one)
    elif isinstance(value, ast.AST):
        hashed.update(type(value).__name__.encode())
        for field, one in ast.iter_fields(value):
            if isinstance(value, ast.ClassDef) and field == "body":
                one = [part for part in value.body if not isinstance(part, _FUNCTIONS)]
            if one is not None and one != [] and field not in _UNSEEN:
                hashed.update(field.encode())
                _feed(hashed, one)
        hashed.update(b".")
    else:
        hashed.update(repr(value).encode())


def _is_text(node: object) -> bool:
    """A string that stands alone: a docstring, or a note below a constant."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
