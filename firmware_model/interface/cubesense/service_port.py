"""The one-letter protocol of CubeSense's service port, for a bench computer.

CubeSense thesis, appendix E: 115200 baud, 8N1. Assumed, because the thesis does not say: a failed
capture is not answered, and the download reads the camera's own memory.
"""

from cubestack.firmware_model.interface.codec.letters import Letter, LetterProtocol
from cubestack.firmware_model.interface.cubesense.codes import IMAGE_BYTES, Camera, Sram

_STORED = b"Y"


def _capture(letter: str, camera: Camera) -> Letter:
    meaning = f"capture an image with the {camera.name} camera"
    return Letter(letter, f"TAKE_{camera.name}", meaning, len(_STORED), _STORED)


def _download(letter: str, camera: Camera) -> Letter:
    meaning = f"send the image in {Sram(camera).name}, row by row"
    return Letter(letter, f"SEND_{camera.name}", meaning, IMAGE_BYTES)


#: Letters that capture an image, by camera.
CAPTURES = {Camera.NADIR: _capture("a", Camera.NADIR), Camera.SUN: _capture("q", Camera.SUN)}

#: Letters that send the image in a camera's own memory.
DOWNLOADS = {Camera.NADIR: _download("s", Camera.NADIR), Camera.SUN: _download("w", Camera.SUN)}

SERVICE_PORT = LetterProtocol(115_200, (*CAPTURES.values(), *DOWNLOADS.values()))
