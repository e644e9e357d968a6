"""CubeSense's pair of FPGAs with a user's own design in one of them or in both."""

from collections.abc import Mapping

from amaranth.back import rtlil
from amaranth.hdl import Instance, Module
from amaranth.lib.wiring import In

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.blocks.pinned import PinnedComponent, RtlilComponent, Stride
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.cubesense.pair import CubeSensePair


class _Fpga(PinnedComponent):
    """An FPGA whose RTLIL is added to that of the pair."""

    def __init__(self, design: RtlilComponent, name: str) -> None:
        super().__init__(design.pins)
        self._name = name

    def elaborate(self, platform: object) -> Module:
        m = Module()
        ports = {
            f"{'i' if member.flow is In else 'o'}_{name}": getattr(self, name)
            for name, member in self.signature.members.items()
        }
        m.submodules.design = Instance(self._name, **ports)
        return m


class ForeignPair(CubeSensePair, RtlilComponent):
    """The pair; FPGAs that are not in ``designs`` are the shipped ones."""

    def __init__(
        self,
        designs: Mapping[Side, RtlilComponent],
        read_out: ReadOut = FULL_SIZE,
        mcu_addressing: bool = False,
    ) -> None:
        super().__init__(read_out, mcu_addressing)
        self._designs = designs
        self._writes = False  # RTLIL, in which a design is an instance

    @property
    def title(self) -> str:
        return " and ".join(design.title for design in self._designs.values())

    @property
    def strides(self) -> tuple[Stride, ...]:
        return ()  # nothing of a user's design is assumed

    def _fpga(self, side: Side) -> PinnedComponent:
        if side not in self._designs:
            return super()._fpga(side)
        design = self._designs[side]
        return _Fpga(design, f"{side}_design") if self._writes else design

    def rtlil(self, name: str) -> str:
        self._writes = True
        parts = [str(rtlil.convert(self, name=name, emit_src=False))]
        self._writes = False
        parts += [design.rtlil(f"{side}_design") for side, design in self._designs.items()]
        top, *others = parts
        return "\n".join([top, *(text.replace("attribute \\top 1\n", "") for text in others)])
