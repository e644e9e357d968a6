"""The declaration of a sensor, which all generic code works with.

Command line, shell, fixtures, conformance, recordings, faults and gateware tools query a
``Device`` and name no sensor. Attributes that need the emulator are callables, so listing devices
does not load it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, field
from keyword import iskeyword
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar

from cubestack.firmware_model.interface.cameras.registers import CameraRegisterMap
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE, PROFILES, Switches
from cubestack.firmware_model.interface.devboard.address import FORM as BOARD_FORM
from cubestack.firmware_model.interface.devboard.address import PREFIX as BOARD_PREFIX
from cubestack.firmware_model.interface.devboard.address import parse_address
from cubestack.firmware_model.values import TEXT, Declaration, ValueKind
from cubestack.firmware_model.versions import SENSOR
from cubestack.host.clients.contract import Client, DeviceClient
from cubestack.host.options import SWITCH, option_string

if TYPE_CHECKING:
    from cubestack.emulator.boards.contract import Board
    from cubestack.emulator.rtl.wiring import Wiring
    from cubestack.emulator.scene.form import SceneForm
    from cubestack.firmware_model.interface.efm32gg.table import Processor
    from cubestack.hdl.contract.contract import Contract
    from cubestack.hdl.flow.top import TopTable
    from cubestack.hdl.proofs.prover import Proof
    from cubestack.host.devices.experiment import AnyExperiment
    from cubestack.host.pictures.overlay import Overlay

Engine: TypeAlias = str
"""How to run an FPGA: one of ``ENGINES``, or the address of a development board."""

ENGINES = {
    "auto": "compiled, if a compiler is installed",
    "compiled": "the compiled design",
    "exact": "compiled, without shortcuts: clock by clock",
    "python": "Amaranth's simulator",
}

ENGINE_FORM = "|".join([*ENGINES, BOARD_FORM])


def engine_name(text: str) -> Engine:
    """Check it; ValueError for a text that names no engine."""
    if text.startswith(BOARD_PREFIX):
        parse_address(text)
    elif text not in ENGINES:
        raise ValueError(f"{text!r} is no engine; choose from {', '.join(ENGINES)}, {BOARD_FORM}")
    return text


#: Progress display: (items, total, label) -> the same items.
Shown = Callable[[Iterable[Any], int, str], Iterator[Any]]

BoardT_co = TypeVar("BoardT_co", bound="Board", covariant=True)
ClientT_co = TypeVar("ClientT_co", bound=DeviceClient, covariant=True)


VERSION = SENSOR.current
"""Of what `cubestack.sensor` offers to sensors of other distributions."""

FILE = "FILE"
"""``metavar`` of an option that names a file."""


def _file(given: Any) -> Any:
    if not isinstance(given, str | Path):
        raise TypeError
    return given


@dataclass(frozen=True)
class BoardOption(Declaration):
    """An option that one device's board has, beside those of all.

    Its name is the keyword of ``Device.open_board`` and that in recordings. With choices it is one
    of these texts, with a metavar any text, else a flag.

    Attributes:
        notice: what a user must know of a value, or None.
        known: texts that have a meaning of their own.
        unset: what it means when it is empty, a word or two for lists.
        repeats: whether the command line joins several by commas.
        serves: whether it leads a line to a port, so only commands that serve ports have it.
    """

    name: str
    meaning: str
    choices: tuple[str, ...] = ()
    default: str | bool = False
    _: KW_ONLY
    notice: Callable[[str], str | None] = lambda _value: None
    known: tuple[str, ...] = ()
    unset: str = ""
    repeats: bool = False
    serves: bool = False

    def __post_init__(self) -> None:
        kind = ValueKind("file", "a file", _file, str) if self.is_file else TEXT
        object.__setattr__(self, "kind", kind if self.choices or self.metavar else SWITCH)

    @property
    def is_file(self) -> bool:
        """Whether it names a file, or one of ``known``."""
        return self.metavar == FILE

    @property
    def flag(self) -> str:
        """As the command line has it."""
        return option_string(self.name)


#: Options of every device with an FPGA.
GATEWARE_OPTIONS = (
    BoardOption(
        "gateware",
        "your own FPGA design in place of the shipped one: Verilog files, a folder, a file list "
        "(*.f), or an Amaranth class (docs/how-to/own-gateware.md)",
        default="",
        metavar="FILE[:TOP]|MODULE:CLASS",
        unset="the shipped design",
    ),
    BoardOption(
        "gateware_param",
        "parameter of that design; may be repeated",
        default="",
        metavar="NAME=VALUE",
        unset="its defaults",
        repeats=True,
    ),
)

#: Options of every device that has switches.
PROFILE_OPTIONS = (
    BoardOption(
        "profile",
        f"algorithms as the sources print them, or the best known (default {DEFAULT_PROFILE})",
        PROFILES,
        DEFAULT_PROFILE,
    ),
    BoardOption(
        "set",
        "switches that override the profile; `cubestack registers DEVICE --switches` lists them",
        default="",
        metavar="SWITCH=VALUE,...",
        unset="as the profile",
    ),
)


@dataclass(frozen=True)
class ConformanceNotes:
    """Facts for the protocol suite that the tables don't have, by the tables' names.

    Attributes:
        effects: checks of telecommands whose success takes more to see than a setting that is read
            back: (run, telecommand, list of what is observed), as in ``host.conformance.effects``.
        ended_by: telecommand that ends a mode, by the one that starts it.
        not_shown: telecommands with fields of the same names as telemetry that shows something
            else: what was measured, a clock, or part of what is set.
        keys: fields that say which of several settings a telecommand is for; telemetry shows them
            all, each with its number behind the name.
        optional: telecommands and registers of which some values need an option of the hardware;
            without it they are refused.
        results: frames, or fields as "Frame.Field", with results of measurements and states since
            power-up, which two equal devices need not share.
    """

    effects: Mapping[str, Callable[..., None]] = field(default_factory=dict)
    ended_by: Mapping[str, str] = field(default_factory=dict)
    not_shown: frozenset[str] = frozenset()
    keys: frozenset[str] = frozenset()
    optional: frozenset[str] = frozenset()
    results: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Report:
    """A command that a device adds: `cubestack NAME`.

    Several devices may have one of the same name: `cubestack NAME DEVICE`.

    Attributes:
        name: of the command.
        summary: one phrase for lists.
        load: returns the experiment.
    """

    name: str
    summary: str
    load: "Callable[[], AnyExperiment]"


def check_name(name: str) -> None:
    """Raise ValueError for a name that a device cannot have."""
    if not name.isidentifier() or not name.islower() or iskeyword(name):
        raise ValueError(f"a device's name is an identifier of small letters, not {name}")


@dataclass(frozen=True)
class Device(Generic[BoardT_co, ClientT_co]):
    """A sensor.

    Attributes:
        name: as it is typed, and as recordings have it: lower case.
        title: as it is written.
        summary: one phrase for lists.
        interface: its messages, registers and service port.
        client: makes the device's client from a client of its node.
        open_board: powers a board up: (scene, *, seed, engine), ``switches`` where there are any,
            and, if given, baud (bits per second), kernel and i2c_bus (of a board beside it) and
            what ``options`` names; so each of these needs a default. Raises ValueError for
            invalid values.
        load_scene: reads a scene file; ValueError names the key that is wrong.
        default_scene: what it looks at when nothing is said.
        default_scene_title: that, for the help.
        options: of its board alone.
        has_fpga: whether an engine can be chosen.
        experiment: what ``measure`` does with it; None for nothing.
        reports: further commands about it.
        studies: loads what it offers to a study, by the study's command; each study documents
            what it expects.
        tops: tops of its FPGAs, and blocks, by name, as ``hdl.flow`` takes them.
        proofs: formal properties of them by name.
        contract: what it requires of a design for its FPGA; None where nothing is declared.
        wirings: cameras and memories around tops, by the tops' names; the first is the default.
        prepare: makes what takes seconds the first time, such as a catalogue; it is given what
            shows progress: (items, total, label) -> the items. ``open_board`` makes it silently.
        conformance: what the protocol suite must know of it beside its tables.
        overlay: what its client found in the picture of a name, to be drawn over it; None where
            that is its stars, or nothing.
        processor: its processor as firmware of one's own sees it; None where that can not run.
        image_sensor: registers of its image sensor, where its interface reads single ones.
        scene_form: what tools can do with its scenes beside reading files; None for nothing.
        written_for: version of `cubestack.sensor`.
    """

    name: str
    title: str
    summary: str
    interface: Interface
    client: Callable[[Client], ClientT_co]
    open_board: Callable[..., BoardT_co]
    load_scene: Callable[[Path], Any]
    default_scene: Callable[[], Any]
    default_scene_title: str
    options: tuple[BoardOption, ...] = ()
    has_fpga: bool = True
    experiment: "Callable[[], AnyExperiment] | None" = None
    reports: tuple[Report, ...] = ()
    studies: Mapping[str, Callable[[], Any]] = field(default_factory=dict)
    tops: "Callable[[], TopTable]" = dict
    proofs: "Callable[[], Mapping[str, Proof]]" = dict
    contract: "Callable[[], Contract] | None" = None
    wirings: "Callable[[], Mapping[str, Callable[[], Wiring]]]" = dict
    prepare: Callable[[Shown], None] = lambda _shown: None
    conformance: ConformanceNotes = field(default_factory=ConformanceNotes)
    processor: "Callable[[], Processor] | None" = None
    overlay: "Callable[[Any, str], Overlay] | None" = None
    image_sensor: CameraRegisterMap | None = None
    scene_form: "Callable[[], SceneForm[Any]] | None" = None
    written_for: int = VERSION

    def __post_init__(self) -> None:
        """Raise ValueError for a name that cannot be used everywhere, or a newer version."""
        check_name(self.name)
        if self.interface.name.lower() != self.name:
            raise ValueError(f"the interface of {self.name} is called {self.interface.name}")
        try:
            SENSOR.check(self.written_for)
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None

    @property
    def switches(self) -> type[Switches]:
        """Where its firmware can do what its documents print, or better."""
        return self.interface.switches

    @property
    def all_options(self) -> tuple[BoardOption, ...]:
        """Options of its board, and those that choose its gateware and its profile."""
        own = {option.name for option in self.options}
        gateware = [one for one in GATEWARE_OPTIONS if self.has_fpga and one.name not in own]
        profile = PROFILE_OPTIONS if self.switches.declared() else ()
        return (*self.options, *gateware, *profile)

    def study(self, command: str) -> Any:
        """What it offers to a study, or None."""
        load = self.studies.get(command)
        return load and load()

    def scene(self, given: Any) -> Any:
        """The scene of ``given``: None the default, text or a path a file, else itself."""
        if given is None:
            return self.default_scene()
        return self.load_scene(Path(given)) if isinstance(given, str | Path) else given


#: Any device.
AnyDevice: TypeAlias = "Device[Board, DeviceClient]"
