"""The one-letter protocol with the bench computer: the port's interrupts and answers.

CubeSense thesis, appendix E. Letters are answered one after the other, an image in pieces, between
which the program does other jobs. Assumed: at most four letters wait, and further ones are lost;
other bytes are ignored; a failed capture, and an image that cannot be read, are not answered. The
I2C register's stream waits for the end of an image here: taking turns, each would start its own
image again for every piece.
"""

from collections import deque
from dataclasses import dataclass

from cubestack.firmware_model.cubesense.download import ImageReader, ImageSender
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware, Port
from cubestack.firmware_model.cubesense.jobs import Background, JobQueue
from cubestack.firmware_model.cubesense.measurement import Measurement
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.interface.codec.letters import Letter
from cubestack.firmware_model.interface.cubesense import codes, service_port
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Routine

LETTERS = 4  #: most letters that wait

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
    reader: ImageReader
    measurement: Measurement

    def __post_init__(self) -> None:
        self._letters: deque[Letter] = deque()
        self._work = Background(self._serve)
        self._image = ImageSender(self.hardware, self.meter, self.reader, Port.BENCH)

    def uart_byte(self, byte: int) -> None:
        self.meter.charge(uart_interrupt=1)
        letter = service_port.SERVICE_PORT.find(byte)
        if letter is None or len(self._letters) >= LETTERS:
            return
        self._letters.append(letter)
        self.queue.request(self._work)
        self.hardware.wake()

    def uart_silence(self) -> None:
        """Interrupt: nothing was received for a while, which has no effect here."""

    def _serve(self) -> Routine[None]:
        """Main loop: answer the oldest letter, an image piece by piece."""
        letter = self._letters[0]
        camera = _CAMERAS[letter]
        if letter == service_port.CAPTURES[camera]:
            done = yield from self._capture(letter, camera)
        else:
            done = yield from self._image.send_some(codes.Sram(camera))
        if done:
            self._letters.popleft()
            self._image.begin()
        if self._letters:
            self.queue.request(self._work, next_turn=True)

    def _capture(self, letter: Letter, camera: codes.Camera) -> Routine[bool]:
        sram = codes.Sram(camera)
        self.state.schedule(camera, sram, detect=False)
        yield from self.measurement.measure(camera, sram, detect=False)
        if self.state.results[camera].capture.stored:
            self._image.send(letter.answer or b"")
        return True
