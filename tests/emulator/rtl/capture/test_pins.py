import numpy as np
import pytest

from cubestack.emulator.rtl.capture.capture import Capture, CaptureError, Channel
from cubestack.emulator.rtl.capture.pins import signals
from cubestack.firmware_model.interface.cubestar.pins import PUBLISHED


def capture(*channels: Channel, changes: tuple[tuple[int, int, int], ...] = ()) -> Capture:
    """Channels, all of which become 1 at time 0 unless there are ``changes``."""
    rows = changes or tuple((0, number, 1) for number in range(len(channels)))
    times, numbers, levels = (np.array(column) for column in zip(*rows, strict=True))
    return Capture(channels, times, numbers.astype(np.int32), levels, 100)


@pytest.mark.parametrize(
    ("channel", "pin", "bits"),
    [
        (Channel("ack"), "ACK", 1),
        (Channel("SRAM_A[3]"), "SRAM_A", 1 << 3),
        (Channel("sram_a12"), "SRAM_A", 1 << 12),
        (Channel("SRAM_A_12"), "SRAM_A", 1 << 12),
        (Channel("SRAM_D<7>"), "SRAM_D", 1 << 7),
        (Channel("PIXDATA", 8), "PIXDATA", 0xFF),
        (Channel("SRAM_A[19:0]", 20), "SRAM_A", 0xFFFFF),
        (Channel("DATA[7:4]", 4), "DATA", 0xF0),
        (Channel("SRAM_D_OE"), "SRAM_D_OE", 1),
    ],
)
def test_channels_are_pins_by_name(channel: Channel, pin: str, bits: int) -> None:
    (found,) = signals(capture(channel), PUBLISHED).items()
    assert (found[0], found[1].bits) == (pin, bits)


@pytest.mark.parametrize(
    ("channels", "mapping", "reason"),
    [
        (
            ["D0"],
            {},
            r"channel D0 is no pin; the pins are PIXCLK, PIXDATA\[7:0\], HSYNC.*--map D0=PIN",
        ),
        (["ACK[0]"], {"ACK*": "FOO"}, r"channel ACK\[0\] \(mapped to FOO\) is no pin"),
        (["SRAM_A20"], {}, "channel SRAM_A20 is no pin"),
        (
            ["ACK", "D1"],
            {"D1": "ack"},
            "channels ACK and D1 are both ACK; --map D1=- leaves one out",
        ),
        (["ACK"], {"D1": "RNW"}, "no channel is called D1; the channels are ACK"),
        (["D0"], {"*": "-"}, "no channel is used; the channels are D0"),
    ],
)
def test_wrong_channels_are_one_line(
    channels: list[str], mapping: dict[str, str], reason: str
) -> None:
    with pytest.raises(CaptureError, match=reason):
        signals(capture(*map(Channel, channels)), PUBLISHED, mapping)


def test_lines_of_a_bus_are_put_together() -> None:
    bus = capture(
        Channel("D0"),
        Channel("D9"),
        changes=((0, 0, 1), (5, 1, 1), (5, 0, 0), (5, 0, 1), (9, 1, -1)),
    )
    (found,) = signals(bus, PUBLISHED, {"D0": "DATA0", "D9": "DATA2"}).values()
    assert found.times.tolist() == [0, 5, 9]
    assert found.levels.tolist() == [0b001, 0b101, 0b001]
    assert found.known.tolist() == [0b001, 0b101, 0b001]
    assert [array.tolist() for array in found.at(np.array([-1, 7]))] == [[0, 5], [0, 5]]
