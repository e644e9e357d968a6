"""The one-letter bench protocol's side of the bench computer; the port's interrupts and answers.

CubeSense thesis, appendix E. Letters are answered one after the other, a picture in pieces, between
which the program does other jobs. Assumed: four letters wait at most, and one that meets more is
lost; other bytes are ignored; a capture that fails, and a picture that can not be read, are not
answered. The I2C register's stream waits for the end of a picture here: taking turns, each would
begin its own anew for every piece.
"""

from collections import deque
from dataclasses import dataclass

from cubestack.firmware_model.cubesense.download import PictureReader
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware, Port
from cubestack.firmware_model.cubesense.jobs import Background, JobQueue
from cubestack.firmware_model.cubesense.measurement import Measurement
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.interface.codec.letters import Letter
from cubestack.firmware_model.interface.cubesense import codes, service_port
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine, Sleep

LETTERS = 4
"""Letters that wait."""

CHUNK_BYTES = 24
"""Bytes of a picture that are read and handed to the UART at once, while as many may still wait."""

_BYTE_US = -(-10 * 1_000_000 // service_port.SERVICE_PORT.baud)

_CAMERAS: dict[Letter, codes.Camera] = {
    letter: camera
    for table in (service_port.CAPTURES, service_port.DOWNLOADS)
    for camera, letter in table.items()
}


@dataclass(eq=False)
class BenchLink:
    """Answers letters."""

    hardware: CubeSenseHardware
    meter: Meter
    state: State
    queue: JobQueue
    reader: PictureReader
    measurement: Measurement

    def __post_init__(self) -> None:
        """No letter waits."""
        self._letters: deque[Letter] = deque()
        self._work = Background(self._serve)
        self._sent = 0

    def uart_byte(self, byte: int) -> None:
        """Interrupt: a byte came."""
        self.meter.charge(uart_interrupt=1)
        letter = service_port.SERVICE_PORT.find(byte)
        if letter is None or len(self._letters) >= LETTERS:
            return
        self._letters.append(letter)
        self.queue.request(self._work)
        self.hardware.wake()

    def uart_silence(self) -> None:
        """Interrupt: nothing came for a while, which means nothing here."""

    def _serve(self) -> Routine[None]:
        """Main loop: answer the oldest letter, a picture piece by piece."""
        letter = self._letters[0]
        camera = _CAMERAS[letter]
        if letter == service_port.CAPTURES[camera]:
            done = yield from self._capture(letter, camera)
        else:
            done = yield from self._send(codes.Sram(camera))
        if done:
            self._letters.popleft()
            self._sent = 0
        if self._letters:
            self.queue.request(self._work, next_turn=True)

    def _capture(self, letter: Letter, camera: codes.Camera) -> Routine[bool]:
        sram = codes.Sram(camera)
        self.state.schedule(camera, sram, detect=False)
        yield from self.measurement.measure(camera, sram, detect=False)
        if self.state.results[camera].capture.stored:
            self._uart_send(letter.answer or b"")
        return True

    def _send(self, sram: codes.Sram) -> Routine[bool]:
        """Send what there is room for; True at the picture's end."""
        too_many = self.hardware.uart_backlog(Port.BENCH) - CHUNK_BYTES
        if too_many > 0:
            now_us: int = yield ReadTimer()
            yield Sleep(now_us + too_many * _BYTE_US)
            return False
        count = min(CHUNK_BYTES, codes.IMAGE_BYTES - self._sent)
        data = yield from self.reader.read_run(sram, self._sent, count)
        if data is None:
            return True
        self._uart_send(data)
        self._sent += count
        return self._sent == codes.IMAGE_BYTES

    def _uart_send(self, data: bytes) -> None:
        self.meter.charge(uart_interrupt=len(data))
        self.hardware.uart_send(data, Port.BENCH)
