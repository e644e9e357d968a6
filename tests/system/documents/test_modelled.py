"""What architecture.md lists as modelled: the registered hazards, faults and switches."""

from cubestack.emulator.faults.table import FAULTS
from cubestack.firmware_model.interface.codec.switches import Switches
from cubestack.host.devices.registry import BUILT_IN, device
from cubestack.host.experiments.hazard_options import known
from tests.system.conftest import ROOT

BEGIN, END = "<!-- generated from hazards, faults and switches -->\n", "<!-- end -->\n"


def modelled() -> str:
    """The list of the page."""
    switches = {
        device(name).title: ", ".join(f"`{one}`" for one in names_of(device(name).switches))
        for name in BUILT_IN
    }
    return "\n".join(
        (
            f"- Hazards of skies, lenses and pixels ([hazards.md](hazards.md)): {listed(known())}",
            f"- Faults ([fault-kinds.md](reference/fault-kinds.md)): {listed(FAULTS)}",
            "- Switches between published and better ([switches.md](reference/switches.md)): "
            f"{'; '.join(f'{title} {names}' for title, names in switches.items())}",
        )
    )


def names_of(switches: type[Switches]) -> list[str]:
    return list(switches.declared())


def listed(names: object) -> str:
    return ", ".join(f"`{name}`" for name in sorted(names))  # type: ignore[call-overload]


def test_architecture_lists_what_is_modelled() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    assert page.split(BEGIN)[1].split(END)[0].strip() == modelled()
