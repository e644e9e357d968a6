from functools import partial
from itertools import count
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import Camera, ImageSize, Sram
from cubestack.host.clients.cubesense.download import ServicePortClient, download_image, picture_of
from cubestack.host.clients.node import NodeClient
from cubestack.host.errors import BadAnswerError, CommandRefusedError, NoAnswerError

from ...conftest import LetterLine


@pytest.fixture
def client(uart: Any) -> NodeClient:
    return NodeClient(uart, INTERFACE)


@pytest.fixture
def download(client: NodeClient) -> Any:
    """Downloads the smallest size from SRAM1."""
    return partial(download_image, client, Sram.SRAM1, ImageSize.SIDE_64)


@pytest.fixture(autouse=True)
def pictures(node: Any) -> None:
    node.pictures[:] = np.random.default_rng(9).integers(0, 256, node.pictures.shape)


@pytest.mark.parametrize("size", ImageSize)
def test_every_size_returns_its_subsampled_pixels(
    client: NodeClient, node: Any, size: ImageSize
) -> None:
    seen: list[tuple[int, int]] = []
    square = download_image(client, Sram.SRAM2, size, lambda *done: seen.append(done))
    assert (square.shape, square.dtype) == ((size.side, size.side), np.uint8)
    step = 1024 // size.side
    np.testing.assert_array_equal(picture_of(square), node.pictures[1, ::step, ::step])
    margins = square.copy()
    picture_of(margins)[:] = 0
    assert not margins.any()
    assert seen == [(number, size.frames) for number in range(1, size.frames + 1)]
    assert len(node.log) == size.frames


def test_a_frame_is_polled_every_40_ms_for_at_most_2_s(download: Any, node: Any, uart: Any) -> None:
    node.preparing = 3
    download()
    assert uart.silences.count(0.04) == 3 * 32
    uart.silences.clear()
    node.preparing = 49
    download()
    uart.silences.clear()
    node.preparing = 50
    with pytest.raises(NoAnswerError, match="image frame 0 not ready within 2 s"):
        download()
    assert uart.silences.count(0.04) == 50


def test_damaged_image_frame_is_read_up_to_3_times(download: Any, node: Any) -> None:
    node.damaged = 2
    square = download()
    np.testing.assert_array_equal(picture_of(square), node.pictures[0, ::16, ::16])
    node.damaged = 3
    with pytest.raises(BadAnswerError, match=r"image frame 0: checksum 0x40, not 0x00, in 3 reads"):
        download()


def test_lost_acknowledge_requests_the_frame_again(download: Any, node: Any, uart: Any) -> None:
    requests = count()  # the first two of the second frame are lost
    uart.mangle = lambda data: b"" if next(requests) in (3, 4) else data
    square = download()
    np.testing.assert_array_equal(picture_of(square), node.pictures[0, ::16, ::16])
    assert [values.get("Frame", 0) for _, values in node.log] == [0, 1, 1, *range(1, 32)]


def test_reports_missing_acknowledges_after_3_attempts(download: Any, node: Any, uart: Any) -> None:
    requests = count()
    uart.mangle = lambda data: data if next(requests) < 3 else b""
    with pytest.raises(NoAnswerError, match="no acknowledge of telecommand NextImageFrame"):
        download()
    assert [name for name, _ in node.log].count("NextImageFrame") == 3


def test_refused_download_is_not_retried(download: Any, node: Any) -> None:
    node.refusals.append(4)
    with pytest.raises(CommandRefusedError, match="StartImageDownload refused: BUFFER_FULL"):
        download()


def test_picture_of_rejects_other_image_shapes() -> None:
    with pytest.raises(ValueError, match=r"side of 1024, 512, 256, 128, 64, not .* \(480, 640\)"):
        picture_of(np.zeros((480, 640), np.uint8))


PICTURE = np.random.default_rng(4).integers(0, 256, (480, 640), np.uint8)


@pytest.mark.parametrize(("camera", "letters"), [(Camera.NADIR, "as"), (Camera.SUN, "qw")])
def test_service_port_captures_and_downloads_an_image(camera: Camera, letters: str) -> None:
    take, send = letters
    line = LetterLine(**{take: b"Y", send: PICTURE.tobytes()})
    ServicePortClient(line).take(camera)
    line.chunk = 1000
    seen: list[tuple[int, int]] = []
    picture = ServicePortClient(line).download(camera, lambda *done: seen.append(done))
    assert line.requests == letters.encode()
    np.testing.assert_array_equal(picture, PICTURE)
    assert (seen[0], seen[-1]) == ((1000, 307_200), (307_200, 307_200))


def test_discards_earlier_bytes() -> None:
    line = LetterLine(s=PICTURE.tobytes())
    line.pending += b"Y" * 5000
    np.testing.assert_array_equal(ServicePortClient(line).download(Camera.NADIR), PICTURE)


def test_reads_nothing_after_the_answer() -> None:
    line = LetterLine(s=PICTURE.tobytes() + b"more")
    line.chunk = 10**6
    ServicePortClient(line).download(Camera.NADIR)
    assert line.pending == b"more"
    line = LetterLine(a=b"Yes")
    ServicePortClient(line).take(Camera.NADIR)
    assert line.pending == b"es"


def test_reports_silence_and_wrong_answers() -> None:
    line = LetterLine(a=b"N", s=bytes(307_199))
    with pytest.raises(NoAnswerError, match=r"bench letter 'q': 0 bytes of 1 came, .* for 3 s"):
        ServicePortClient(line, timeout_s=3.0).take(Camera.SUN)
    assert line.silences == [0.0, 3.0]
    with pytest.raises(BadAnswerError, match="'a' answered with b'N', not b'Y'"):
        ServicePortClient(line).take(Camera.NADIR)
    with pytest.raises(NoAnswerError, match="'s': 307199 bytes of 307200 came"):
        ServicePortClient(line).download(Camera.NADIR)
