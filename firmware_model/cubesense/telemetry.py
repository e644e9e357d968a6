"""Values of each telemetry frame; interrupt context, so nothing here waits."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cubestack.firmware_model.cubesense.download import Download
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.cubesense.supply import Supply
from cubestack.firmware_model.cubesense.vision.edges import MAX_EDGES
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import SHOWN, shown_values
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, pins, telemetry
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.state import identification

NODE_TYPE = INTERFACE.node_type

SERIAL_BYTES = INTERFACE.telemetry("SerialNumber").length

EDGE_FRAMES = -(-MAX_EDGES // codes.EDGES_PER_FRAME)

_COUNTER = 1 << 16
_HUNDREDTHS = 100

Values = dict[str, Any]


@dataclass(eq=False)
class Telemetry:
    """Answers telemetry requests."""

    hardware: CubeSenseHardware
    meter: Meter
    state: State
    supply: Supply
    download: Download

    def __post_init__(self) -> None:
        self._sources: dict[str, Callable[[], Values]] = {
            "Identification": lambda: identification(
                INTERFACE, NODE_TYPE, self.hardware.uptime_us()
            ),
            "SerialNumber": self._serial_number,
            "CommunicationStatus": self._communication,
            "TcmdProcessed": self._processed,
            "Power": self._power,
            "Configuration": self._configuration,
            "ImageFrame": self._frame,
            "ImageFrameInfo": self._frame_info,
            **{f"NadirEdges{part + 1}": partial(self._edges, part) for part in range(EDGE_FRAMES)},
            SHOWN: lambda: shown_values(self.state.switches.now),
            "NadirSearchMode": lambda: {"Search": self.state.nadir_search},
        }
        for camera in codes.Camera:
            number = camera + 1
            self._sources[f"Masks{number}"] = partial(self._masks, camera)
            self._sources[f"Details{number}"] = partial(self._details, camera)
            self._sources[f"Quality{number}"] = partial(self._quality, camera)
            self._sources[f"PhaseTimes{number}"] = partial(self._times, camera)
        shown = {identifier: camera for camera, identifier in telemetry.RESULTS.items()}
        shown |= {identifier: camera for identifier, (camera, _) in telemetry.SCHEDULES.items()}
        for identifier, camera in shown.items():
            self._sources[INTERFACE.telemetry(identifier).name] = partial(self._result, camera)

    def values(self, message: Message) -> Values:
        """Values of every field of ``message``, one of the interface's frames."""
        return self._sources[message.name]()

    def _serial_number(self) -> Values:
        text = self.hardware.serial_number.encode("ascii", "replace")
        return {"SerialNumber": text[:SERIAL_BYTES].ljust(SERIAL_BYTES, b"\0")}

    def _communication(self) -> Values:
        state = self.state
        return {
            "TcmdCount": state.telecommands % _COUNTER,
            "TlmCount": state.telemetries % _COUNTER,
            **state.flag_values(),
        }

    def _processed(self) -> Values:
        state = self.state
        return {
            "LastTcmd": state.last_command,
            "Processed": state.last_processed,
            "Error": state.last_error,
        }

    def _result(self, camera: codes.Camera) -> Values:
        result = self.state.results[camera]
        return {
            "Alpha": result.alpha / _HUNDREDTHS,
            "Beta": result.beta / _HUNDREDTHS,
            "Capture": result.capture,
            "Detect": result.detect,
        }

    def _power(self) -> Values:
        currents = self.supply.currents()
        over = self.state.over_current
        return {
            "Current3V3": currents[pins.Monitor.SUPPLY_3V3],
            "CurrentSram1": currents[pins.Monitor.SRAM1],
            "CurrentSram2": currents[pins.Monitor.SRAM2],
            "Current5V": currents[pins.Monitor.SUPPLY_5V],
            "OverCurrent1": over[codes.Sram.SRAM1],
            "OverCurrent2": over[codes.Sram.SRAM2],
        }

    def _configuration(self) -> Values:
        values: Values = {}
        for camera, settings in self.state.cameras.items():
            number = camera + 1
            values |= {
                f"Threshold{number}": settings.threshold,
                f"AutoAdjust{number}": settings.auto_adjust,
                f"Exposure{number}": settings.exposure,
                f"Gain{number}": settings.gain,
                f"BlueGain{number}": settings.blue_gain,
                f"RedGain{number}": settings.red_gain,
            }
        return values

    def _frame(self) -> Values:
        self.meter.charge(i8=len(self.download.data))
        return {"Frame": self.download.data.tobytes()}

    def _frame_info(self) -> Values:
        return {"FrameNumber": self.download.number, "Checksum": self.download.checksum}

    def _masks(self, camera: codes.Camera) -> Values:
        return {
            f"{name}{area}": limit
            for area, mask in enumerate(self.state.cameras[camera].masks, start=1)
            for name, limit in zip(("XMin", "XMax", "YMin", "YMax"), mask, strict=True)
        }

    def _details(self, camera: codes.Camera) -> Values:
        result = self.state.results[camera]
        return {
            "X": result.x / _HUNDREDTHS,
            "Y": result.y / _HUNDREDTHS,
            "Radius": result.radius / _HUNDREDTHS,
            "Points": result.points,
            "Sram": result.sram,
            "FirstX": result.first[0],
            "FirstY": result.first[1],
            "PixelsRead": result.pixels_read,
        }

    def _quality(self, camera: codes.Camera) -> Values:
        result = self.state.results[camera]
        return {
            "SigmaAlpha": result.sigma[0] / _HUNDREDTHS,
            "SigmaBeta": result.sigma[1] / _HUNDREDTHS,
            "Rms": result.rms / _HUNDREDTHS,
            "Found": result.found,
            "Reason": result.reason,
        }

    def _times(self, camera: codes.Camera) -> Values:
        phases = ("Wait", "Store", "Search", "Centroid", "Total")
        return {name: getattr(self.state.results[camera], f"{name.lower()}_us") for name in phases}

    def _edges(self, part: int) -> Values:
        edges = self.state.results[codes.Camera.NADIR].edges
        shown = np.zeros((MAX_EDGES, 2))
        shown[: len(edges)] = edges / codes.EDGE_UNIT
        numbers = range(codes.EDGES_PER_FRAME * part, codes.EDGES_PER_FRAME * (part + 1))
        places = {f"{axis}{n + 1}": shown[n, "XY".index(axis)] for n in numbers for axis in "XY"}
        return {"Count": len(edges)} | places
