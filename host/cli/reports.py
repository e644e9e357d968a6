"""Commands about particular devices, which the devices themselves declare."""

from dataclasses import dataclass, field
from pkgutil import resolve_name
from typing import Any

from cubestack.host.cli.commands import STUDIES
from cubestack.host.devices.device import AnyDevice, Report
from cubestack.host.devices.registry import devices


@dataclass
class Reports:
    """One command: what the devices that have it say of themselves."""

    summary: str  #: one phrase for the help
    #: device and report of each device that has it
    declared: list[tuple[AnyDevice, Report]] = field(default_factory=list)
    group: str = STUDIES

    def load(self) -> Any:
        """The command; it loads the emulator."""
        found = {one.name: (one, report.load()) for one, report in self.declared}
        return resolve_name("cubestack.host.cli.report_command:ReportCommand")(found)


def reports() -> dict[str, Reports]:
    """The commands that the registered devices declare, by name."""
    found: dict[str, Reports] = {}
    for device in devices():
        for report in device.reports:
            command = found.setdefault(report.name, Reports(report.summary))
            command.declared.append((device, report))
    return found
