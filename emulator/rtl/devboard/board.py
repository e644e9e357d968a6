"""Opens the development board that a wiring's design runs on."""

from cubestack.emulator.rtl.devboard.channel import Channel, DevboardError, SerialChannel
from cubestack.emulator.rtl.devboard.engine import DevboardEngine
from cubestack.emulator.rtl.devboard.link import Link
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.devboard import BoardAddress, Identity, Layout
from cubestack.hdl.flow.generate import design_hash


def open_board(
    wiring: Wiring,
    address: BoardAddress,
    sram_timing: SramTiming | None = None,
    *,
    skipping: bool = True,
) -> DevboardEngine:
    """The engine on the board at ``address``.

    Raises DevboardError if there is none, or it has another design.
    """
    if len(address.ports) > 1:
        name = type(wiring.component).__name__
        raise DevboardError(f"{name} runs on one board; give one port, not {len(address.ports)}")
    channel = SerialChannel(address.ports[0], address.baud)
    return engine_on(channel, address.baud, wiring, sram_timing, skipping=skipping)


def engine_on(
    channel: Channel,
    baud: int,
    wiring: Wiring,
    sram_timing: SramTiming | None = None,
    *,
    skipping: bool = True,
) -> DevboardEngine:
    """The engine on the board behind ``channel``, which is closed after an error."""
    link = Link(channel)
    try:
        outputs = link.open(baud)
        assert link.identity is not None
        check_design(wiring, link.identity, channel.name)
        return DevboardEngine(wiring, link, outputs, sram_timing, skipping=skipping)
    except BaseException:
        channel.close()
        raise


def check_design(wiring: Wiring, found: Identity, port: str) -> None:
    """DevboardError if the board at ``port`` has another design than the wiring."""
    component = wiring.component
    wanted = bytes.fromhex(design_hash(component))[: len(found.design)]
    inputs, outputs = Layout.inputs(component.pins), Layout.outputs(component.pins)
    if found.design == wanted and (found.inputs, found.outputs) == (inputs.size, outputs.size):
        return
    raise DevboardError(
        f"the board on {port} has the top {found.name} (design {found.design.hex()}), but this"
        f" device needs {type(component).__name__} (design {wanted.hex()}); write its bitstream:"
        " `cubestack hdl board` with --device and the options of the emulation"
    )
