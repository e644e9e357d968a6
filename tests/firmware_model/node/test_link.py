"""The link that all nodes share: frames and messages, good and bad, on both buses.

Each node's own link serves canned telemetry here, in front of no program.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.firmware_model.aramis.link import SEND_BUFFER_BYTES as ARAMIS_BUFFER
from cubestack.firmware_model.aramis.link import AramisLink
from cubestack.firmware_model.aramis.state import State as AramisState
from cubestack.firmware_model.cubesense.links.node import SEND_BYTES as CUBESENSE_BUFFER
from cubestack.firmware_model.cubestar.link import CubeStarLink
from cubestack.firmware_model.cubestar.memory import RETENTION_BYTES
from cubestack.firmware_model.cubestar.state import State as CubeStarState
from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import CostTable
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.firmware_model.node.commands import QUEUE_DEPTH
from cubestack.firmware_model.node.link import SatelliteLink, longest_command
from cubestack.firmware_model.node.state import NodeState
from tests.together import together

from ..cubesense.links_harness import Links
from ..host_side import HostSide
from ..runner import Runner


class Canned(Runner, HostSide):
    """A link whose telemetry shows reset values, and memories for its state."""

    def __init__(self, interface: Interface, table: CostTable) -> None:
        HostSide.__init__(self)
        Runner.__init__(self, table)
        self.interface = interface
        self.flash = FlashStore()
        self.retention = bytearray(RETENTION_BYTES)
        self.state: NodeState
        if interface is CUBESTAR:
            self.state = state = CubeStarState(self, self.meter)  # type: ignore[arg-type]
            self.served: SatelliteLink = CubeStarLink(self.meter, state, self.values)
        else:
            self.state = other = AramisState(self.flash)
            shown = self.values, lambda _command: None
            self.served = AramisLink(self, self.meter, other, *shown)  # type: ignore[arg-type]

    @property
    def link(self) -> SatelliteLink:
        return self.served

    def values(self, message: Message) -> dict[str, Any] | None:
        return dict(message.reset_values()) if message.supported else None

    def run(self, until_us: int | None = None) -> None:
        self.queue.clear()

    @property
    def queue(self) -> Any:
        return self.served.queue  # type: ignore[attr-defined]


@dataclass
class Node:
    make: Callable[[], Any]  #: its link, alone
    interface: Interface  #: what it serves
    buffer: int  #: what its UART may still have to send
    refused: tuple[str, dict[str, Any]]  #: a telecommand with a parameter out of range
    #: names of its error flags, as ``LinkFlags`` and ``BusFlags`` name what they stand for
    flags: dict[str, set[str]]


#: Error flags by what raises them: of CubeStar, CubeSense and AraMiS; "-" for none.
FLAGS = """
protocol                UART_ProtocolError              UartProtocolError  UartProtocolError
incomplete              UART_MsgIncomplete              UartMsgIncomplete  UartIncomplete
timeout       UART_MsgIncomplete+UART_RXTimeout  UartMsgIncomplete  UartIncomplete+UartTimeout
no_id                   I2C_WaitForIDReadRequestError   I2cTlmReadError    I2cReadWithoutId
unknown_telemetry       TlmIDError                      UartProtocolError  TlmIdError
unknown_telemetry_read  TlmIDError                      I2cTlmReadError    TlmIdError
unknown_command         TcmdIDError                     -                  TcmdIdError
uart_few                UART_Tcmd_TooFewParm            -                  TcmdLengthError
uart_many               UART_Tcmd_TooManyParm           -                  TcmdLengthError
i2c_few                 I2C_TCMD_TooFewParm             -                  TcmdLengthError
i2c_many                I2C_TCMD_TooManyparm            -                  TcmdLengthError
uart_overflow           UART_TcmdBufOfError             TcmdBufferOverrun  TcmdBufferOverflow
i2c_overflow            I2C_TcmdBufOFError              TcmdBufferOverrun  TcmdBufferOverflow
parameter               ImageBlockSizeError             -                  ParameterError
"""


def flags_of(number: int) -> dict[str, set[str]]:
    rows = [line.split() for line in FLAGS.strip().splitlines()]
    return {row[0]: set(row[1 + number].split("+")) - {"-"} for row in rows}


NODES = {
    "cubestar": Node(
        lambda: Canned(CUBESTAR, CORTEX_M3),
        CUBESTAR,
        2048,
        ("ImageBlockSet", {"BlockNumber": 4096}),
        flags_of(0),
    ),
    "cubesense": Node(
        Links, Links.interface, CUBESENSE_BUFFER, ("CaptureAndDetect", {"Sram": 2}), flags_of(1)
    ),
    "aramis": Node(
        lambda: Canned(ARAMIS, BLACKFIN_BF533),
        ARAMIS,
        ARAMIS_BUFFER,
        ("SetExposure", {"Rows": 0}),
        flags_of(2),
    ),
}

TELECOMMANDS = [
    pytest.param(node, message, id=f"{name}-{message.name}")
    for name, node in NODES.items()
    for message in node.interface.telecommands
]
TELEMETRIES = [
    pytest.param(node, message, id=f"{name}-{message.name}")
    for name, node in NODES.items()
    for message in node.interface.telemetries
    if message.supported
    # changed by asking
    if (name, message.name) != ("cubesense", "CommunicationStatus")
    if "Then" not in message.name
]


@pytest.fixture(params=NODES)
def node(request: pytest.FixtureRequest) -> Node:
    return NODES[request.param]


@pytest.fixture
def unit(node: Node) -> Any:
    return node.make()


def packed(message: Message, **values: object) -> bytes:
    return bytes([message.id]) + message.pack(**{**message.reset_values(), **values})


def good(node: Node) -> bytes:
    return packed(next(m for m in node.interface.telecommands if 0 < m.length < 5 and m.id > 1))


def ack(error: AckError) -> list[bytes]:
    return [bytes([error])]


def flags(node: Node, *names: str) -> set[str]:
    return set().union(*(node.flags[name] for name in names))


@together(("node", "message"), TELECOMMANDS)
def test_telecommands_are_taken_from_both_buses(node: Node, message: Message) -> None:
    unit, data = node.make(), packed(message)
    # The reset value is no direction; no picture was selected.
    refused = message.name in ("GetAttitudeNearVector", "NextImageFrame")
    assert unit.frames(data) == ack(AckError.BAD_PARAMETER if refused else AckError.OK)
    assert unit.i2c_write(data) == len(data)
    assert len(unit.queue) == (0 if refused else 2)
    unit.run()
    unit.state.flags.clear()
    assert unit.frames(data + b"\0") == ack(AckError.WRONG_LENGTH)
    assert unit.state.flags == flags(node, "uart_many")
    unit.i2c_write(data + b"\0")
    assert unit.state.flags == flags(node, "uart_many", "i2c_many")
    if message.length:
        unit.state.flags.clear()
        assert unit.frames(data[:-1]) == ack(AckError.WRONG_LENGTH)
        assert unit.state.flags == flags(node, "uart_few")
        unit.i2c_write(data[:-1])
        assert unit.state.flags == flags(node, "uart_few", "i2c_few")
    assert not unit.queue


def test_rejects_unknown_telecommand(node: Node, unit: Any) -> None:
    known = {message.id for message in node.interface.telecommands}
    for identifier in (identifier for identifier in range(128) if identifier not in known):
        unit.state.flags.clear()
        assert unit.frames(bytes([identifier])) == ack(AckError.INVALID_ID)
        assert unit.state.flags == flags(node, "unknown_command")
        unit.i2c_write(bytes([identifier]))
    assert not unit.queue


def test_frame_longer_than_any_telecommand_is_refused(node: Node, unit: Any) -> None:
    for length in (1, 2, 1000):
        data = good(node).ljust(longest_command(node.interface) + length, b"\0")
        assert unit.frames(data) == ack(AckError.WRONG_LENGTH)
    assert unit.state.flags == flags(node, "uart_many")


def test_write_longer_than_any_telecommand_is_not_acknowledged(node: Node, unit: Any) -> None:
    longest = longest_command(node.interface)
    assert unit.i2c_write(good(node).ljust(longest + 50, b"\0")) == longest + 1
    assert unit.state.flags == flags(node, "i2c_many")
    assert not unit.queue


def test_telecommand_with_a_bad_parameter_is_refused(node: Node, unit: Any) -> None:
    name, values = node.refused
    assert unit.send(name, **values) == AckError.BAD_PARAMETER
    assert unit.state.flags == flags(node, "parameter")
    assert not unit.queue


@pytest.mark.parametrize("bus", ["uart", "i2c"])
def test_full_buffer_rejects_telecommands(node: Node, unit: Any, bus: str) -> None:
    data = good(node)
    for _ in range(QUEUE_DEPTH):
        assert unit.frames(data) == ack(AckError.OK)
    if bus == "uart":
        assert unit.frames(data) == ack(AckError.BUFFER_FULL)
    else:
        unit.i2c_write(data)
    assert unit.state.flags == flags(node, f"{bus}_overflow")
    assert len(unit.queue) == QUEUE_DEPTH
    name, values = node.refused  # told apart from a full buffer
    assert unit.send(name, **values) == AckError.BAD_PARAMETER
    assert unit.frames(b"\x63")[0][0] in (AckError.INVALID_ID, AckError.WRONG_LENGTH)
    unit.run()
    assert unit.frames(data) == ack(AckError.OK)


def test_repeated_start_ends_a_telecommand(node: Node, unit: Any) -> None:
    unit.link.i2c_start(False)
    for byte in good(node):
        unit.link.i2c_write(byte)
    assert unit.i2c_read(8, 0x80) == unit.frames(b"\x80")[0]
    assert len(unit.queue) == 1


@together(("node", "message"), TELEMETRIES)
def test_every_telemetry_frame_answers_on_both_buses(node: Node, message: Message) -> None:
    unit = node.make()
    (answer,) = unit.frames(bytes([message.id, 1, 2, 3]))  # parameters are ignored
    assert len(answer) == message.length
    if not message.steps:
        assert unit.i2c_read(message.length, message.id) == answer
        assert unit.i2c_read(message.length + 3, message.id) == answer + b"\xff\xff\xff"
    assert not unit.state.flags


def test_unknown_telemetry_id_gets_no_answer(node: Node, unit: Any) -> None:
    known = {message.id for message in node.interface.telemetries if message.supported}
    unknown = [identifier for identifier in range(128, 256) if identifier not in known]
    for identifier in unknown:
        assert unit.frames(bytes([identifier])) == []
    assert unit.state.flags == flags(node, "unknown_telemetry")
    unit.state.flags.clear()
    assert unit.i2c_read(2, unknown[0]) == b"\xff\xff"
    assert unit.state.flags == flags(node, "unknown_telemetry_read")


def test_i2c_read_without_an_id_returns_ff_and_sets_a_flag(node: Node, unit: Any) -> None:
    assert unit.i2c_read(3) == b"\xff\xff\xff"
    assert unit.state.flags == flags(node, "no_id")


def test_i2c_answer_is_readable_once_in_another_transfer(node: Node, unit: Any) -> None:
    assert unit.i2c_write(b"\x80") == 1
    assert unit.i2c_read(8) == unit.frames(b"\x80")[0]
    assert not unit.state.flags
    assert unit.i2c_read(1) == b"\xff"
    assert unit.state.flags == flags(node, "no_id")


def test_answers_that_the_send_buffer_has_no_room_for_are_dropped(node: Node, unit: Any) -> None:
    answer = unit.wire(encode_frame(b"\x80"))
    unit.backlog = node.buffer - len(answer)
    assert unit.wire(encode_frame(b"\x80")) == answer
    unit.backlog += 1
    assert unit.wire(encode_frame(b"\x80")) == b""
    assert unit.frames(good(node)) == ack(AckError.OK)  # a shorter one fits


@pytest.mark.parametrize(
    ("noise", "name"),
    [
        (b"\x00", "protocol"),
        (b"\x1f\x00", "protocol"),
        (b"\x1f\x7f\x07\x1f\x00", "protocol"),  # unknown escape in a frame
        (b"\x1f\x7f\x1f\xff", "protocol"),  # empty frame
        (b"\x1f\xff" * 3, "protocol"),
        (b"\x1f\x7f\x07\x05", "incomplete"),  # ended by the next frame's start
    ],
)
def test_good_frame_after_a_bad_one_is_acknowledged(
    node: Node, unit: Any, noise: bytes, name: str
) -> None:
    assert unit.uart(noise + encode_frame(good(node))) == ack(AckError.OK)
    assert unit.state.flags == flags(node, name)
    assert len(unit.queue) == 1


def test_silence_after_half_a_frame_sets_the_time_out_flag(node: Node, unit: Any) -> None:
    unit.link.uart_silence()
    assert not unit.state.flags  # silence between frames is no error
    half = encode_frame(good(node))[:-1]  # ends in an escape, which would swallow the next start
    assert unit.uart(half) == []
    unit.link.uart_silence()
    assert unit.state.flags == flags(node, "timeout")
    assert unit.frames(good(node)) == ack(AckError.OK)


def test_address_without_data_has_no_effect(unit: Any) -> None:
    unit.i2c_write(b"")
    assert not unit.state.flags
    assert not unit.queue


def test_interrupts_charge_the_meter(node: Node, unit: Any) -> None:
    answer = unit.wire(encode_frame(b"\x80"))
    sent = len(answer) if node is NODES["cubesense"] else 0  # it has no buffer in hardware
    assert unit.meter.counts["uart_interrupt"] == 5 + sent
    assert unit.meter.counts["host_message"] == 1
    unit.i2c_read(8, 0x80)
    assert unit.meter.counts["i2c_interrupt"] == 9
    assert unit.meter.counts["host_message"] == 2


@settings(max_examples=300, deadline=None)
@given(
    name=st.sampled_from(list(NODES)),
    parts=st.lists(
        st.one_of(
            st.binary(min_size=1, max_size=3),
            st.sampled_from([b"\x1f", b"\x7f", b"\xff", b"\x1f\x7f", b"\x1f\xff", bytes(200)]),
        ),
        max_size=12,
    ),
)
def test_after_a_silence_no_good_frame_is_lost(name: str, parts: list[bytes]) -> None:
    node = NODES[name]
    unit, noise = node.make(), b"".join(parts)
    unit.uart(noise)
    unit.link.uart_silence()
    unit.i2c_write(noise)
    unit.run()
    unit.received()
    assert unit.frames(good(node)) == ack(AckError.OK)


@given(
    name=st.sampled_from(list(NODES)),
    front=st.sampled_from([b"", b"\x1f", b"\x1f\x7f\x01", b"\x55"]),
    payload=st.binary(max_size=6),
)
def test_a_block_of_bytes_does_what_each_byte_would(
    name: str, front: bytes, payload: bytes
) -> None:
    one, other = NODES[name].make(), NODES[name].make()
    blocks = [front, encode_frame(payload)]
    for byte in b"".join(blocks):
        one.link.uart_byte(byte)
    for block in blocks:
        other.link.uart_block(block)
    assert other.received() == one.received()
    assert other.state.flags == one.state.flags
    assert other.meter.counts == one.meter.counts
    assert other.meter.total == one.meter.total
