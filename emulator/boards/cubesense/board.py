"""CubeSense's board.

CubeSense thesis, figure 3.9 and tables 3.3 and 3.4: two halves of camera, FPGA and SRAM, one
microcontroller for both, its buses to the satellite, its switches and current monitors.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.contract import Board, BoardOptions
from cubestack.emulator.boards.cubesense.processor import GpioPins, Pic18f45k20
from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring, with_designs
from cubestack.emulator.bus.i2c import Forwarder
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.ov7620.lens_error import FIELD_DEG, NOMINAL, draw_lens
from cubestack.emulator.camera.ov7620.sensor import Ov7620
from cubestack.emulator.camera.ov7620.view import EarthSunView
from cubestack.emulator.faults.sites import CameraSite, Sites
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.factory import EngineKind, make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, SensorTruth
from cubestack.emulator.sim.power import Part, PowerTable
from cubestack.emulator.sim.processor import Processor
from cubestack.emulator.sim.virtual_time import PS_PER_US
from cubestack.firmware_model.cubesense.program import CubeSenseProgram
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, pins
from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, ROWS, Camera, Sram
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, READ_OUTS, Action, actions
from cubestack.firmware_model.interface.cubesense.pins import CONTROLS, ENABLE
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.interface.cubesense.service_port import SERVICE_PORT
from cubestack.firmware_model.interface.cubesense.switches import (
    DEFAULT_SWITCHES,
    CubeSenseSwitches,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import pic18f45k20
from cubestack.hdl.cubesense.pair import CubeSensePair

_SRAM = {"standby": 4.6, "active": 7.6}  # fitted, as all below
_CAMERA = {"on": 25.15}

#: CubeSense thesis, table 7.1: the whole board's current at 5 V in eight states. Each figure is
#: fitted to it, as the mean over both halves: 4.4 and 4.8 mA per memory, 27.8 and 22.5 mA per
#: camera, 7.4 and 7.2 mA per half that is imaging. The split of the last is assumed. Reading has a
#: ninetieth of imaging's clock, so its current is neglected. Currents are measured at 5 V, ahead of
#: linear regulators, so they equal the parts' own currents.
CUBESENSE_POWER = PowerTable(
    volts=5.0,
    parts={
        "processor": Part(None, {"reset": 0.0, "on": 4.0}),
        "fpgas": Part(None, {"on": 8.4}),
        "sun_fpga": Part(None, {"idle": 0.0, "imaging": 4.3}),
        "nadir_fpga": Part(None, {"idle": 0.0, "imaging": 4.3}),
        "sram1": Part("SRAM1", _SRAM),
        "sram2": Part("SRAM2", _SRAM),
        "sun_camera": Part("sun_camera", _CAMERA),
        "nadir_camera": Part("nadir_camera", _CAMERA),
    },
    channels={"SRAM1": None, "SRAM2": None, "sun_camera": None, "nadir_camera": None},
)

BOOT_US = 1_000
"""Start-up of the oscillator and of the C library: assumed."""

HALVES = {Camera.SUN: "sun", Camera.NADIR: "nadir"}
"""Names of each half's camera and memory in the engine, and prefix in the power table."""

ROW_BYTES = 1024
"""Bytes per row of a memory: a power of two, as an address is row and column."""

STORING = (Action.STORE, Action.STORE_OTHER)
CLOCKED = (*STORING, Action.SEND_PICTURE)


@lru_cache(maxsize=4)
def wiring_of(gateware: str, *, mcu_addressing: bool = False) -> Wiring:
    """The FPGAs with gateware ``gateware``; cached, as the hash of the design is slow."""
    return cubesense_wiring(CubeSensePair(READ_OUTS[gateware], mcu_addressing))


class CubeSenseBoard(Board):
    """One emulated CubeSense.

    Attributes:
        hardware: the processor's peripherals, as its program uses them.
        bench_uart: the device's end of the serial line with the bench protocol.
    """

    engine: RtlEngine
    program: CubeSenseProgram

    def __init__(
        self,
        scene: EarthSunScene | EarthSunView,
        *,
        engine: EngineKind = "auto",
        baud: int | None = None,
        mcu_addressing: bool = False,
        uart: str = "node",
        bench_baud: int = SERVICE_PORT.baud,
        i2c_address: int = INTERFACE.i2c_address,
        register_address: int = REGISTERS.i2c_address,
        switches: CubeSenseSwitches = DEFAULT_SWITCHES,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up.

        Args:
            scene: what the cameras see.
            engine: see ``make_engine``.
            baud, bench_baud: rates of the satellite's serial line and of the one with the bench
                protocol; None for the published rate.
            mcu_addressing: FPGAs with the option that the processor chooses addresses.
            uart: protocol of the satellite's serial line, "node" or "registers".
            i2c_address, register_address: 7-bit addresses of the node and the register protocol.
            switches: variants of the program, the gateware and the lenses; the lens errors are
                those of unit ``seed``.
            common: seed, kernel and i2c_bus, see ``Board``.
        """
        super().__init__(CUBESENSE_POWER, **common)
        wiring = wiring_of(switches.gateware, mcu_addressing=mcu_addressing)
        self.engine = make_engine(with_designs(wiring, *self._gateware), engine)
        drawn = switches.lens == "residuals"
        self.cameras = {
            Camera[target.name]: Ov7620(
                scene, target, lens=draw_lens(target, self.seed) if drawn else NOMINAL
            )
            for target in CameraTarget
        }
        if uart == "registers":
            rate = baud or REGISTERS.baud or INTERFACE.baud
            self._serial_line(rate, lambda: self.program.backup, title="register protocol")
            self.i2c_bus.attach(i2c_address, Forwarder(lambda: [self.program.node]))
        else:
            self._node_link(lambda: self.program.node, baud or INTERFACE.baud, i2c_address)
        self.bench_uart = self._serial_line(
            bench_baud, lambda: self.program.bench, "bench_uart", "bench protocol", ".bench"
        )
        for camera in Camera:
            self._scramble(self.engine.memories[HALVES[camera]])
            self._connect(camera)
        self._lines = GpioPins(self.kernel, self.cameras, self.power)
        self.power.on_switch = self._supply_switched
        self._commanded: dict[Camera, Action] = dict.fromkeys(Camera, Action.STANDBY)
        self._storing_since_ps: dict[Camera, int] = {}
        self._stored: dict[Camera, RollingShutter] = {}
        meter = Meter(pic18f45k20(library=switches.library, clock=switches.clock))
        self.hardware = Pic18f45k20(self, mcu_addressing=mcu_addressing)

        def boot(_cause: int) -> CubeSenseProgram:
            self.hardware.reset()
            self._release_pins()
            self.program = CubeSenseProgram(self.hardware, meter, switches)
            return self.program

        self.processor = Processor(
            self.kernel,
            meter,
            self.engine,
            None,
            boot,
            power_on_cause=0,
            boot_us=BOOT_US,
            other_pins=self._lines,
            on_pin=lambda pin, _level: self._pin_changed(pin),
        )
        self.i2c_bus.attach(register_address, Forwarder(lambda: [self.program.registers]))

    @property
    def scene(self) -> EarthSunScene:
        return self.cameras[Camera.SUN].scene

    @scene.setter
    def scene(self, scene: object) -> None:
        for camera in self.cameras.values():
            camera.scene = scene

    def probes(self) -> dict[str, int | str]:
        probes = super().probes()
        for camera, half in HALVES.items():
            result = self.program.state.results[camera]
            probes[f"{half}_capture"] = codes.CaptureResult(result.capture).name
            probes[f"{half}_detect"] = codes.DetectResult(result.detect).name
        return probes

    def sites(self) -> Sites:
        return replace(
            super().sites(),
            controls=(pins.RNW, pins.EDGE, pins.SHIFT, *ENABLE),
            fpgas={half: (ENABLE[camera], 1) for camera, half in HALVES.items()},
            cameras={
                half: CameraSite(self.cameras[camera], self.cameras[camera].power, f"{half}_camera")
                for camera, half in HALVES.items()
            },
        )

    def pictures(self) -> dict[str, NDArray[np.uint8]]:
        """See ``Board``; a memory row has 1024 bytes."""
        return {
            f"memory {name}": memory.reshape(-1, ROW_BYTES)[:ROWS, :COLUMNS]
            for name, memory in self.engine.memories.items()
        }

    def truth(self, camera: Camera) -> SensorTruth | None:
        """True values for ``camera`` at mid-exposure of the stored frame's middle row, or None."""
        shutter = self.stored_frame(camera)
        if shutter is None:
            return None
        middle_ps = shutter.mid_exposure_ps((ROWS - 1) / 2)
        return self.scene.truth(CameraTarget[camera.name], middle_ps, FIELD_DEG)

    def truths(self) -> dict[str, NDArray[np.float64]]:
        found = {camera.name.lower(): self.truth(camera) for camera in self.cameras}
        return {
            name: np.array([truth.alpha_deg, truth.beta_deg])
            for name, truth in found.items()
            if truth is not None and truth.visible
        }

    def stored_frame(self, camera: Camera) -> RollingShutter | None:
        """Exposure of the frame of ``camera`` that was stored last; None before the first."""
        return self._stored.get(camera)

    def _connect(self, camera: Camera) -> None:
        sensor, half = self.cameras[camera], HALVES[camera]
        sensor.on_change = lambda: self.engine.stream_changed(half)
        self.engine.attach(sensor, half)

    def _advance_engine(self) -> None:
        """Run the engine to the present; it may be ahead, see emulator/sim/processor.py."""
        self.engine.run(max(self.kernel.now, self.engine.now_ps))

    def _release_pins(self) -> None:
        """Set all pins to their level in reset, which resistors define."""
        self._advance_engine()
        for pin in (*ENABLE, *pins.COMMON_PINS):
            self.engine.set_pin(pin, pin.level)
        self._command()
        self._lines.release()
        self.power.set_state("processor", "reset")
        started = self.kernel.timeout(BOOT_US * PS_PER_US)
        assert started.callbacks is not None
        started.callbacks.append(lambda _event: self.power.set_state("processor", "on"))

    def _pin_changed(self, pin: str) -> None:
        if pin in CONTROLS:
            self._command()

    def _command(self) -> None:
        """Update currents and stored frames after a change of the control lines."""
        commanded = actions(*(self.engine.get_pin(pin) for pin in CONTROLS))
        before, self._commanded = self._commanded, dict(zip(Camera, commanded, strict=True))
        for camera, action in self._commanded.items():
            clocked, memory = action in CLOCKED, "active" if action in STORING else "standby"
            self.power.set_state(f"{HALVES[camera]}_fpga", "imaging" if clocked else "idle")
            self.power.set_state(Sram(camera).name.lower(), memory)
        for camera in Camera:
            stored, stores = (_stores(commanded, camera) for commanded in (before, self._commanded))
            if stores and not stored:
                self._storing_since_ps[camera] = self.kernel.now
            elif stored and not stores:
                self._note_stored(camera)

    def _note_stored(self, camera: Camera) -> None:
        sensor = self.cameras[camera]
        if not sensor.running:
            return
        # The FPGA stores the first frame that follows a complete gap.
        since_ps = self._storing_since_ps[camera] + round(FULL_SIZE.frame_gap * sensor.period)
        shutter = sensor.frame_from(since_ps)
        if self.kernel.now >= shutter.readout_ps + ROWS * shutter.line_ps:
            self._stored[camera] = shutter

    def _supply_switched(self, channel: str, on: bool) -> None:
        self._advance_engine()
        for camera, half in HALVES.items():
            if channel == Sram(camera).name:
                self.engine.power_memory(half, on)
                if not on:
                    self._scramble(self.engine.memories[half])
            elif channel == f"{half}_camera":
                self.cameras[camera].power(on, self.engine.now_ps)


def _stores(commanded: dict[Camera, Action], camera: Camera) -> bool:
    other = Camera(1 - camera)
    return commanded[camera] is Action.STORE or commanded[other] is Action.STORE_OTHER
