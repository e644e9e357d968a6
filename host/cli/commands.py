"""The commands of ``cubestack``, by name: built-in ones, those of other packages and devices.

A package registers commands by an entry point in the group ``cubestack.commands`` that leads to a
``dict[str, Command]``.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import resolve_name
from typing import Any, Protocol

from cubestack.host.devices.device import AnyDevice, Report
from cubestack.host.devices.registry import devices

GROUP = "cubestack.commands"

EMULATOR, STUDIES, TOOLS = "Emulator", "Studies", "Tools"
"""Groups of the help text, in its order."""


class Listed(Protocol):
    """What the help text needs of a command."""

    @property
    def group(self) -> str: ...
    @property
    def summary(self) -> str: ...
    def load(self) -> Any: ...


@dataclass(frozen=True)
class Command:
    """A command."""

    group: str  #: of the help text
    summary: str  #: one phrase for lists
    module: str  #: has ``add_arguments(parser)``, ``run(args)`` and a docstring for the help

    def load(self) -> Any:
        return import_module(self.module)


BUILT_IN = {
    name: Command(group, summary, f"cubestack.host.cli.{name.replace('-', '_')}")
    for group, name, summary in (
        (EMULATOR, "emulate", "serve emulated devices on serial ports until Ctrl-C"),
        (EMULATOR, "run", "run an unmodified program that sees an emulated I2C bus"),
        (EMULATOR, "measure", "measure attitudes or directions, each beside the truth"),
        (EMULATOR, "shell", "read, write and watch registers by name"),
        (EMULATOR, "registers", "list a device's telecommands and telemetry"),
        (EMULATOR, "export", "write the interface for C, Python, XTCE, COSMOS, Wireshark, SVD"),
        (EMULATOR, "conformance", "check a device's protocol against the tables"),
        (EMULATOR, "ground", "open a page in the browser that shows and commands a device"),
        (
            EMULATOR,
            "hdl",
            "FPGA designs: area, Verilog files, proofs, tests of your own, waveforms",
        ),
        (TOOLS, "replay", "play a recording to an emulated device and compare its answers"),
        (TOOLS, "decode", "list the messages of a recording, or write them as a table"),
        (TOOLS, "new-sensor", "write a sensor of your own: messages, firmware, board, tests"),
        (TOOLS, "completion", "print the completion script for bash, zsh or fish"),
    )
}


@cache
def commands() -> dict[str, Command]:
    """All commands by name; a built-in one can't be replaced."""
    found = dict(BUILT_IN)
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        for name, command in entry.load().items():
            found.setdefault(name, command)
    return found


def with_headings(known: Mapping[str, Listed]) -> Iterator[tuple[str, str, Listed]]:
    """Heading, name and command, group by group; only the first of a group has a heading."""
    for group in (EMULATOR, STUDIES, TOOLS):
        heading = group
        for name, command in known.items():
            if command.group == group:
                yield heading, name, command
                heading = ""


@dataclass
class Reports:
    """One command: what the devices that have it say of themselves."""

    summary: str  #: one phrase for the help
    #: device and report of each device that has it
    declared: list[tuple[AnyDevice, Report]] = field(default_factory=list)
    group: str = STUDIES

    def load(self) -> Any:
        found = {one.name: (one, report.load()) for one, report in self.declared}
        return resolve_name("cubestack.host.cli.measure:ReportCommand")(found)


def reports() -> dict[str, Reports]:
    """The commands that the registered devices declare, by name."""
    found: dict[str, Reports] = {}
    for device in devices():
        for report in device.reports:
            command = found.setdefault(report.name, Reports(report.summary))
            command.declared.append((device, report))
    return found
