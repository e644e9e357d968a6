import numpy as np
import pytest

from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.clients.cubesense.download import ServicePortClient
from cubestack.host.errors import BadAnswerError, NoAnswerError

from ...conftest import LetterLine

PICTURE = np.random.default_rng(4).integers(0, 256, (480, 640), np.uint8)


@pytest.mark.parametrize(("camera", "letters"), [(Camera.NADIR, "as"), (Camera.SUN, "qw")])
def test_takes_and_downloads_a_picture(camera: Camera, letters: str) -> None:
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
