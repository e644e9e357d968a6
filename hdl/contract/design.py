"""A design that is checked against a contract: the user's, or the shipped one."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.contract.contract import Contract, Size
from cubestack.hdl.contract.image import load_image
from cubestack.hdl.flow.generate import rtlil_text, verilog_text
from cubestack.hdl.flow.tools import yosys_files
from cubestack.hdl.user import GatewareError, load_gateware

_VERILOG = """
read_rtlil dut.il
proc
memory_collect
pmuxtree
write_verilog -noattr dut.v
"""


@dataclass(frozen=True)
class Design:
    """``text`` as for ``hdl.user.load_gateware``; the shipped design without one.

    ``image`` is the module that says what it keeps of a frame; see :mod:`.image`.
    """

    contract: Contract
    text: str = ""
    parameters: Mapping[str, int | str] | None = None
    folder: Path | None = None
    image: str = ""

    def check_image(self) -> None:
        """Raise GatewareError if ``image`` is no such module, or cannot be used."""
        if self.image and not self.sized:
            names = " and ".join(self.contract.parameters(self.contract.full))
            raise GatewareError(f"--image {self.image}: {self.title} has no parameters {names}")
        load_image(self.image, *self.contract.proof, self.folder)

    @property
    def title(self) -> str:
        return self.text or f"{self.contract.title} as shipped"

    def make(self, size: Size) -> PinnedComponent:
        """The design for images of this size; raises GatewareError, one line for each reason.

        Every size but the full one is set by the contract's parameters.
        """
        if not self.text:
            return self.contract.shipped(size)
        given = dict(self.parameters or {})
        if size != self.contract.full:
            given |= self.contract.parameters(size)
        return load_gateware(self.text, self.contract.pins(size), given, self.folder)

    def verilog(self, size: Size) -> str:
        """For a simulator; its module is "dut"."""
        made = self.make(size)
        if not self.text:
            return verilog_text(made, "dut")
        return yosys_files(_VERILOG, {"dut.il": rtlil_text(made, "dut")}, "dut.v")[1]

    @cached_property
    def sized(self) -> bool:
        """Whether it has parameters for the image's size, and pins that follow them."""
        if not self.text:
            return True
        if {*self.contract.parameters(self.contract.full)} & {*(self.parameters or {})}:
            return False
        try:
            self.make(self.contract.proof)
        except GatewareError:
            self.make(self.contract.full)  # the reason that counts, if there is one
            return False
        return True
