"""Powers devices up for experiments; options that all experiments share."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic

from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE, Switches
from cubestack.firmware_model.values import whole
from cubestack.host.devices.device import BoardT_co, ClientT_co, Device, Engine, Shown
from cubestack.host.emulation.emulated import EmulatedDevice, power_up
from cubestack.host.options import Options, file_option

if TYPE_CHECKING:
    from cubestack.emulator.faults.plan import Plan


@dataclass(frozen=True, kw_only=True)
class MeasureOptions(Options):
    """Options of everything that ``measure`` measures."""

    scene: Any = file_option(None, "TOML scene; default: a random one")
    frames: int = whole(1, "number of frames (default 1)", 1)
    seed: int = whole(0, "seed of everything random (default 0)", 0)
    faults: "Path | Plan | None" = file_option(None, "TOML fault plan (docs/how-to/faults.md)")


def _silent(items: Iterable[Any], _total: int, _label: str) -> Iterator[Any]:
    yield from items


@dataclass(frozen=True)
class Opener(Generic[BoardT_co, ClientT_co]):
    """Powers a device up for an experiment with the user's board options."""

    device: Device[BoardT_co, ClientT_co]  #: to power up
    engine: Engine = "auto"  #: how its FPGA is run
    board: Mapping[str, Any] = field(default_factory=dict)  #: options of its board
    shown: Shown = _silent  #: progress display of slow first-time work
    #: called with each device after power-up
    opened: Callable[[EmulatedDevice[BoardT_co, ClientT_co]], object] = lambda _emulated: None

    @cached_property
    def switches(self) -> Switches:
        """Switches of the firmware at power-up."""
        chosen = self.board.get("profile", DEFAULT_PROFILE), self.board.get("set", "")
        return self.device.switches.of(*chosen)

    @cached_property
    def rates(self) -> bool:
        """Whether the firmware rates its results: the Python model, except in ``published``."""
        return not self.board.get("firmware") and self.switches.profile != DEFAULT_PROFILE

    def __call__(
        self, scene: Any, *, seed: int, faults: "Path | Plan | None" = None, **options: Any
    ) -> EmulatedDevice[BoardT_co, ClientT_co]:
        """The device, with its scene and a fault plan (or its file) injected.

        ``options`` are board keywords that the experiment sets. Raises ValueError for an invalid
        scene or plan.
        """
        if isinstance(faults, Path):
            from cubestack.emulator.faults.plan import load_plan

            faults = load_plan(faults)
        emulated = power_up(
            self.device, scene, seed=seed, engine=self.engine, **{**self.board, **options}
        )
        if faults is not None:
            try:
                emulated.faults.load(faults)
            except ValueError:
                emulated.close()
                raise
        try:
            self.opened(emulated)
        except (ValueError, OSError):
            emulated.close()
            raise
        return emulated
