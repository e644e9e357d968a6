import numpy as np
import pytest

from cubestack.firmware_model.cubesense.download import frame_pixels
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.mcu.requests import Request
from tests.tiers import quick

from .links_harness import Links
from .scenery import thumbnail


def ready(node: Links) -> int:
    return int(node.telemetry("ImageFrameInfo")["FrameNumber"])


def shown(node: Links, number: int) -> bytes:
    assert ready(node) == number
    return bytes(node.telemetry("ImageFrame")["Frame"])


def expected(node: Links, sram: codes.Sram, size: codes.ImageSize) -> list[bytes]:
    square = thumbnail(node.pictures[sram].reshape(480, 640), size)
    return [frame.tobytes() for frame in square.reshape(-1, 128)]


@pytest.mark.parametrize("size", quick(codes.ImageSize, 1))
def test_image_download_reads_the_memory_once(node: Links, size: codes.ImageSize) -> None:
    sram = codes.Sram(size % 2)
    node.command("StartImageDownload", Sram=sram, Size=size)
    download = node.commands.download
    frames = [shown(node, 0)]
    for number in range(1, size.frames):
        node.command("NextImageFrame", Frame=number)
        assert download.number == number
        frames.append(download.data.tobytes())
    assert frames == expected(node, sram, size)
    assert node.opened == [sram]
    assert node.read == (640 // size.step) * (480 // size.step)
    assert node.read + node.skipped <= codes.IMAGE_BYTES


def test_image_frames_are_downloaded_in_any_order(node: Links) -> None:
    size = codes.ImageSize.SIDE_128
    frames = expected(node, codes.Sram.SRAM2, size)
    node.command("StartImageDownload", Sram=codes.Sram.SRAM2, Size=size)
    for number in np.random.default_rng(6).permutation(size.frames):
        node.command("NextImageFrame", Frame=int(number))
        assert shown(node, int(number)) == frames[number]


def test_only_backward_image_frame_requests_reopen_the_image(node: Links) -> None:
    node.command("StartImageDownload", Size=codes.ImageSize.SIDE_256)
    for number, begun in ((200, 1), (300, 1), (299, 2), (299, 3), (301, 3)):
        node.command("NextImageFrame", Frame=number)
        assert len(node.opened) == begun


def test_capture_during_an_image_download_only_reopens_the_image(node: Links) -> None:
    size = codes.ImageSize.SIDE_64
    frames = expected(node, codes.Sram.SRAM1, size)
    node.command("StartImageDownload", Size=size)
    for number in range(10, 20):
        node.command("NextImageFrame", Frame=number)
        assert shown(node, number) == frames[number]
        node.command("CaptureOnly", Sram=codes.Sram.SRAM2)
    assert len(node.opened) == 10


def test_download_starts_at_a_later_frame_of_the_other_memory(node: Links) -> None:
    size = codes.ImageSize.SIDE_64
    places = (codes.Sram.SRAM1, 10), (codes.Sram.SRAM2, 15)
    for begun, (sram, number) in enumerate(places, start=1):
        node.send("StartImageDownload", Sram=sram, Size=size)
        node.send("NextImageFrame", Frame=number)  # the first one is not read
        node.run()
        assert shown(node, number) == expected(node, sram, size)[number]
        assert len(node.opened) == begun


def test_no_image_frame_is_ready_until_its_request_is_served(node: Links) -> None:
    node.command("StartImageDownload", Size=codes.ImageSize.SIDE_64)
    seen: list[int] = []
    node.send("NextImageFrame", Frame=0)  # the one that is ready already
    node.on_request = lambda _request: seen.append(ready(node))
    assert ready(node) == codes.EMPTY_FRAME
    node.run()
    assert codes.EMPTY_FRAME in seen
    assert ready(node) == 0


def test_frame_request_replaced_while_waiting_is_not_read(node: Links) -> None:
    node.command("StartImageDownload", Size=codes.ImageSize.SIDE_64)
    node.send("NextImageFrame", Frame=12)
    node.command("NextImageFrame", Frame=14)
    assert shown(node, 14) == expected(node, codes.Sram.SRAM1, codes.ImageSize.SIDE_64)[14]
    assert node.read == 80
    assert node.telemetry("TcmdProcessed")["Processed"] == 1


def test_frame_request_replaced_during_its_read_is_never_ready(node: Links) -> None:
    node.command("StartImageDownload", Size=codes.ImageSize.SIDE_64)
    node.send("NextImageFrame", Frame=14)
    seen = set()
    late = iter([12])

    def look(_request: Request) -> None:
        seen.add(ready(node))
        if node.read > 40:
            for number in late:
                node.send("NextImageFrame", Frame=number)

    node.on_request = look
    node.run()
    assert node.read == 160
    assert seen <= {codes.EMPTY_FRAME, 12}
    assert shown(node, 12) == expected(node, codes.Sram.SRAM1, codes.ImageSize.SIDE_64)[12]


@pytest.mark.parametrize("when", ["before", "meanwhile"])
def test_image_frame_of_an_unpowered_memory_is_empty(node: Links, when: str) -> None:
    size = codes.ImageSize.SIDE_64
    node.command("StartImageDownload", Size=size)
    node.send("NextImageFrame", Frame=15)
    if when == "before":
        node.off = {codes.Sram.SRAM1}
    else:
        node.on_request = lambda _: node.off.update({codes.Sram.SRAM1} if node.read > 40 else ())
    node.run()
    assert ready(node) == codes.EMPTY_FRAME
    assert node.telemetry("TcmdProcessed")["Processed"] == 1
    node.off = set()
    node.on_request = lambda _request: None
    node.command("NextImageFrame", Frame=15)
    assert shown(node, 15) == expected(node, codes.Sram.SRAM1, size)[15]


def test_image_frames_beyond_the_image_need_no_memory(node: Links) -> None:
    node.off = {codes.Sram.SRAM1}
    node.command("StartImageDownload", Size=codes.ImageSize.SIDE_64)
    assert shown(node, 0) == bytes(128)
    assert node.opened == []


@pytest.mark.parametrize("size", codes.ImageSize)
def test_thumbnail_is_padded_to_a_square_and_subsampled(size: codes.ImageSize) -> None:
    picture = np.random.default_rng(3).integers(1, 256, (480, 640), np.uint8)
    canvas = np.pad(picture, ((272, 272), (192, 192)))
    assert canvas.shape == (1024, 1024)
    step = 1024 // size.side
    np.testing.assert_array_equal(thumbnail(picture, size), canvas[::step, ::step])


def test_rejects_missing_frames() -> None:
    for frame in (-1, 32):
        with pytest.raises(ValueError, match=f"SIDE_64 has frames 0 to 31, not {frame}"):
            frame_pixels(codes.ImageSize.SIDE_64, frame)
