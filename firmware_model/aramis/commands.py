"""Effects of the telecommands, which the main loop executes one after the other.

AraMiS thesis, section 2.2. A setting telecommand stores its parameters; the others act at once or
take time. Only the supply is cut off in the interrupt itself, because a latch-up cannot wait.
"""

import numpy as np

from cubestack.firmware_model.aramis.camera import Camera
from cubestack.firmware_model.aramis.catalogue.flash_store import CatalogueStore
from cubestack.firmware_model.aramis.catalogue.upload import CatalogueUpload
from cubestack.firmware_model.aramis.hardware import AramisHardware
from cubestack.firmware_model.aramis.measurement import Measuring
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.attitude.geometry import direction_of
from cubestack.firmware_model.interface import aramis
from cubestack.firmware_model.interface.aramis import BLOCK_BYTES, CatalogueState, SensorState
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine
from cubestack.firmware_model.node.commands import CommandExecutor, QueuedCommand

STREAM_BACKLOG_BYTES = 4 * BLOCK_BYTES


class Commands(CommandExecutor):
    """Executes telecommands."""

    def __init__(
        self,
        hardware: AramisHardware,
        meter: Meter,
        state: State,
        camera: Camera,
        catalogue: CatalogueStore,
        measuring: Measuring,
    ) -> None:
        super().__init__(hardware, state.settings, state.switches)
        self._meter = meter
        self._state = state
        self._camera = camera
        self._catalogue = catalogue
        self._measuring = measuring
        #: the catalogue that is being loaded
        self.upload = CatalogueUpload(hardware, meter, catalogue)
        self._actions |= {
            "SetSystemTime": self._set_time,
            "SetExposure": lambda _: measuring.restart(),
            "SetGain": lambda _: measuring.restart(),
            "SetField": lambda _: measuring.restart(),
            "BeginCatalogue": self._begin_upload,
            "CatalogueBlock": self._upload_block,
            "StopLoop": self._stop_loop,
            "SaveConfig": lambda _: state.settings.save(),
            "ClearConfig": self._clear_config,
            "ClearErrorFlags": lambda _: state.flags.clear(),
            "Reset": self._reset,
        }
        self._routines |= {
            "Activate": self._activate,
            "Deactivate": self._deactivate,
            "GetAttitude": lambda _: measuring.measure(None),
            "GetAttitudeNearVector": self._measure_near_vector,
            "GetAttitudeNearPoint": self._measure_near_point,
            "LatchUpAction": self._latch_up_action,
            "CommitCatalogue": self._commit_upload,
            "StartLoop": self._start_loop,
            "ReloadCatalogue": self._reload,
            "RefreshCatalogue": self._refresh,
            "StreamDownImage": self._stream_image,
            "WriteCameraRegister": self._write_register,
            "SelectCameraRegister": lambda command: camera.select(command.values["Address"]),
        }

    def urgent(self, command: QueuedCommand) -> None:
        """Interrupt: the part of an accepted telecommand that cannot wait for the main loop."""
        latch_up = command.message.name == "LatchUpAction"
        if latch_up and command.values["Step"] == aramis.LatchUpStep.OFF:
            self._camera.cut()

    def _activate(self, _command: QueuedCommand) -> Routine[None]:
        if self._state.active:
            return
        self._state.sensor = SensorState.ACTIVATING
        self._measuring.restart()
        yield from self._camera.start()  # a failure raises its flag; each measurement tries again
        yield from self._load()
        self._state.sensor = SensorState.READY

    def _deactivate(self, _command: QueuedCommand) -> Routine[None]:
        self._state.looping = False
        yield from self._camera.stop()
        self._catalogue.forget()
        self._state.sensor = SensorState.INACTIVE

    def _set_time(self, command: QueuedCommand) -> None:
        values = command.values
        self._state.clock.set(values["JulianDay"], values["Millisecond"], command.received_us)

    def _latch_up_action(self, command: QueuedCommand) -> Routine[None]:
        if command.values["Step"] == aramis.LatchUpStep.OFF or not self._camera.off:
            return
        yield from self._camera.restore()
        if self._state.active:
            yield from self._camera.start()

    def _reset(self, _command: QueuedCommand) -> None:
        self._reset_cause = aramis.ResetCause.TELECOMMAND

    def _clear_config(self, _command: QueuedCommand) -> None:
        self._state.settings.erase()
        self._measuring.restart()

    def _measure_near_vector(self, command: QueuedCommand) -> Routine[None]:
        vector = np.array([command.values[axis] for axis in "XYZ"], np.float32)
        length = np.sqrt(np.float32((vector * vector).sum()))
        self._meter.charge(f32_mul=3, f32_add=2, f32_sqrt=1, f32_div=3)
        yield from self._measuring.measure((vector / length).astype(np.float32))

    def _measure_near_point(self, command: QueuedCommand) -> Routine[None]:
        angles = command.values["RightAscension"], command.values["Declination"]
        yield from self._measuring.measure(direction_of(*angles, self._meter))

    def _start_loop(self, _command: QueuedCommand) -> Routine[None]:
        if not self._state.active:
            self._state.raise_flag("NotActive")
            return
        self._state.loop_due_us = yield ReadTimer()
        self._state.looping = True

    def _stop_loop(self, _command: QueuedCommand) -> None:
        self._state.looping = False

    def _load(self) -> Routine[None]:
        yield from self._catalogue.load()
        self._report_load()

    def _report_load(self) -> None:
        """Raise the flags of the latest pass over the flash."""
        store = self._catalogue
        if store.corrected:
            self._state.raise_flag("CatalogueCorrected")
        if store.lost or store.state is CatalogueState.DAMAGED:
            self._state.raise_flag("CatalogueDamaged")
        if store.state is CatalogueState.MISSING:
            self._state.raise_flag("CatalogueMissing")

    def reload_step(self) -> Routine[None]:
        """Run a slice of a periodic reload, in the main loop's idle time."""
        if (yield from self._catalogue.load_step()):
            self._report_load()

    def _reload(self, _command: QueuedCommand) -> Routine[None]:
        if not self._state.active:
            self._state.raise_flag("NotActive")
            return
        yield from self._load()

    def _refresh(self, _command: QueuedCommand) -> Routine[None]:
        if not self._state.active:
            self._state.raise_flag("NotActive")
            return
        self._state.sensor = SensorState.PROGRAMMING
        yield from self._load()
        yield from self._catalogue.refresh()
        self._state.sensor = SensorState.READY

    def _begin_upload(self, command: QueuedCommand) -> None:
        self.upload.begin(command.values["Length"], command.values["Checksum"])

    def _upload_block(self, command: QueuedCommand) -> None:
        if not self.upload.put(command.values["BlockNumber"], command.values["Data"]):
            self._state.raise_flag("UploadError")

    def _commit_upload(self, _command: QueuedCommand) -> Routine[None]:
        before = self._state.sensor
        self._state.sensor = SensorState.PROGRAMMING
        written = yield from self.upload.commit()
        if not written:
            self._state.raise_flag("UploadError")
        elif before is not SensorState.INACTIVE:
            yield from self._load()
        self._state.sensor = before

    def image_block(self) -> bytes:
        """The selected block of the latest image; zeros before the first."""
        number = int(self._settings.get("ImageBlockSet", "BlockNumber"))
        return self._block(number * BLOCK_BYTES)

    def _block(self, start: int) -> bytes:
        if self._camera.latest is None:
            return bytes(BLOCK_BYTES)
        self._meter.charge(ram_read=BLOCK_BYTES // 4)
        picture = self._camera.picture(self._camera.latest).reshape(-1)
        return picture[start : start + BLOCK_BYTES].tobytes()

    def _stream_image(self, _command: QueuedCommand) -> Routine[None]:
        for start in range(0, aramis.IMAGE_BYTES, BLOCK_BYTES):
            yield from self._await_room(STREAM_BACKLOG_BYTES)
            self._uart.uart_send(encode_frame(self._block(start)))

    def _write_register(self, command: QueuedCommand) -> Routine[None]:
        self._camera.forget_set_up()
        if not (yield from self._camera.write(command.values["Address"], command.values["Value"])):
            self._state.raise_flag("CameraSilent")
