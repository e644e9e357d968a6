"""What a fault is, and when it acts."""

from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

from cubestack.firmware_model.values import DeclaredValues, number, positive

LONGEST_S = 1e9
"""Latest time and longest duration."""

TIMES = {
    "at_s": number(None, "virtual time; now by default", 0, LONGEST_S, "s", formerly="at"),
    "for_s": positive(None, "default: until cleared", high=LONGEST_S, unit="s", formerly="for"),
}
"""When a fault begins, and how long it lasts."""


class FaultError(ValueError):
    """A fault, one of its parameters or its target makes no sense."""


class Site(Enum):
    """Where a fault acts; the value says what its targets are."""

    UART = "serial line"
    I2C = "I2C bus"
    ACKNOWLEDGE = "acknowledge pin of the FPGA"
    CONTROL = "control pin of the FPGA"
    CAMERA = "camera"
    MEMORY = "memory"
    FPGA = "FPGA"
    WHOLE_FPGA = "FPGA that can fail alone"
    SUPPLY = "supply channel"
    PROCESSOR = "processor"
    CORE = "core of a processor with own firmware"


@dataclass(frozen=True)
class Fault(DeclaredValues):
    """Base of all faults; its declared values are its parameters."""

    kind: ClassVar[str]  #: its name in a plan
    site: ClassVar[Site]  #: what it acts on
    momentary: ClassVar[bool]  #: it happens at one instant, so it has no duration
    error = FaultError

    def __init_subclass__(cls, kind: str, site: Site, momentary: bool = False) -> None:
        super().__init_subclass__()
        cls.kind, cls.site, cls.momentary = kind, site, momentary

    @classmethod
    def refusal(cls, name: str, text: str) -> FaultError:
        return FaultError(f"{cls.kind}: {name} {text}")

    @classmethod
    def effect(cls) -> str:
        """What it does, in a sentence."""
        return (cls.__doc__ or "").splitlines()[0]
