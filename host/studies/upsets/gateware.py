"""Options of upsets of a device that takes a user's own gateware."""

from dataclasses import dataclass

from cubestack.firmware_model.values import text
from cubestack.host.studies.upsets.experiment import UpsetOptions

#: Board options that these options set.
DECIDED = ("gateware", "gateware_param")


@dataclass(frozen=True, kw_only=True)
class GatewareUpsetOptions(UpsetOptions):
    """Both are as those of the board."""

    gateware: str = text(
        "", "your own FPGA design (docs/how-to/own-gateware.md)", metavar="FILE[:TOP]|MODULE:CLASS"
    )
    gateware_param: str = text("", "its parameters", metavar="NAME=VALUE,...")
