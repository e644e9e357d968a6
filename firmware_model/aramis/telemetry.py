"""Values of every telemetry frame, computed at the request."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.aramis.camera import Camera
from cubestack.firmware_model.aramis.catalogue.flash_store import CatalogueStore
from cubestack.firmware_model.aramis.commands import Commands
from cubestack.firmware_model.aramis.hardware import AramisHardware
from cubestack.firmware_model.aramis.link import AramisLink
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.attitude.geometry import angles_of
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.interface.aramis import INTERFACE, OnOff
from cubestack.firmware_model.interface.aramis.telemetry import SETTINGS_SHOWN
from cubestack.firmware_model.interface.codec.attitude_quality import UNRATED
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import SHOWN, shown_values
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.state import SERIAL_NUMBER, identification

NODE_TYPE = INTERFACE.node_type

_U16, _U32 = 0xFFFF, 0xFFFF_FFFF

Values = dict[str, Any]


def body_quaternion(rotation: Floats, attitude: Floats) -> Floats:
    """Inertial to body (4,): camera to body, after inertial to camera; all scalar last."""
    (x1, y1, z1, w1), (x2, y2, z2, w2) = rotation.astype(np.float32), attitude.astype(np.float32)
    product = np.array(
        [
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        ],
        np.float32,
    )
    unit: Floats = product / np.sqrt((product * product).sum())
    return unit


def _parts(quaternion: Floats | None) -> Values:
    return {f"Q{index}": 0.0 if quaternion is None else quaternion[index] for index in range(4)}


@dataclass
class Telemetry:
    """Answers telemetry requests; interrupt context, so nothing here waits.

    ``_link`` returns the host's link, which is created later.
    """

    _hardware: AramisHardware
    _meter: Meter
    _state: State
    _camera: Camera
    _catalogue: CatalogueStore
    _commands: Commands
    _link: Callable[[], AramisLink]

    def __post_init__(self) -> None:
        hardware, state, commands = self._hardware, self._state, self._commands
        self._sources: dict[str, Callable[[], Values]] = {
            "Identification": lambda: identification(INTERFACE, NODE_TYPE, hardware.uptime_us()),
            "ExtendedIdentification": self._extended_identification,
            "ErrorFlags": state.flag_values,
            "TcmdProcessed": lambda: self._link().processed(commands.running),
            "SensorStatus": self._sensor_status,
            "SystemTime": self._system_time,
            "Attitude": self._attitude,
            "BodyAttitude": self._body_attitude,
            "Boresight": self._boresight,
            "PhaseTimes": lambda: dict(state.measurement.times_us),
            "CatalogueStatus": self._catalogue_status,
            "UploadStatus": self._upload_status,
            "ImageBlock": lambda: {"Block": commands.image_block()},
            "CameraRegister": self._camera_register,
            "LoopStatus": self._loop_status,
            "DetectionSummary": self._detection_summary,
            "IdentificationSummary": self._identification_summary,
            "Quality": self._quality,
            "StarDetails": self._star_details,
            "SupplyStatus": self._supply_status,
            SHOWN: lambda: shown_values(state.switches.now),
        }

    def values(self, message: Message) -> Values:
        if message.name in SETTINGS_SHOWN:
            return self._state.settings.all(SETTINGS_SHOWN[message.name])
        return self._sources[message.name]()

    def _extended_identification(self) -> Values:
        return {
            "SerialNumber": SERIAL_NUMBER,
            "ResetCause": self._hardware.reset_cause,
            "TcmdCount": self._state.telecommands & _U16,
            "TlmCount": self._state.telemetry & _U16,
        }

    def _sensor_status(self) -> Values:
        return {
            "State": self._state.sensor,
            "Catalogue": self._catalogue.state,
            "CameraSupply": OnOff.OFF if self._camera.off else OnOff.ON,
            "Loop": OnOff(self._state.looping),
            "TimeSet": int(self._state.clock.is_set),
        }

    def _time(self, uptime_us: int) -> Values:
        day, millisecond = self._state.clock.at(uptime_us)
        return {"JulianDay": day & _U32, "Millisecond": millisecond}

    def _system_time(self) -> Values:
        now_us = self._hardware.uptime_us()
        return self._time(now_us) | {"Uptime": now_us // 1000 & _U32}

    def _supply_status(self) -> Values:
        return {
            "Switch": OnOff.OFF if self._camera.off else OnOff.ON,
            "Current": self._hardware.camera_current_ma(),
        }

    def _loop_status(self) -> Values:
        return {
            "Running": OnOff(self._state.looping),
            "Period": self._state.settings.get("StartLoop", "Period"),
            "Iterations": self._state.iterations & _U32,
            "LateIterations": self._state.late & _U16,
        }

    def _attitude(self) -> Values:
        latest = self._state.measurement
        return {
            **_parts(self._state.quaternion),
            **self._time(latest.image_us),
            "ImageUptime": latest.image_us // 1000 & _U32,
            "FrameCounter": latest.frame & _U32,
            "Outcome": latest.outcome,
            "Reason": latest.reason,
            "Mode": latest.mode,
            "Valid": int(latest.valid),
            "Matched": self._state.matched,
            "Detected": latest.detected,
        }

    def _body_attitude(self) -> Values:
        latest, attitude = self._state.measurement, self._state.quaternion
        if attitude is not None:
            rotation = self._state.settings.all("SetBodyRotation")
            parts = np.array([rotation[f"Q{index}"] for index in range(4)], np.float32)
            attitude = body_quaternion(parts, attitude)
            self._meter.charge(f32_mul=20, f32_add=15, f32_sqrt=1, f32_div=4)
        return {
            **_parts(attitude),
            **self._time(latest.image_us),
            "Reason": latest.reason,
            "Valid": int(latest.valid),
        }

    def _boresight(self) -> Values:
        ascension = declination = 0.0
        if self._state.quaternion is not None:
            boresight = dcm(self._state.quaternion, self._meter)[2]
            ascension, declination = angles_of(boresight, self._meter)
        return {
            "RightAscension": ascension,
            "Declination": declination,
            "Valid": int(self._state.measurement.valid),
        }

    def _detection_summary(self) -> Values:
        latest = self._state.measurement
        return {
            "Detected": latest.detected,
            "Mean": latest.mean,
            "Threshold": latest.threshold,
            "Pictures": latest.pictures,
        }

    def _identification_summary(self) -> Values:
        found = self._state.measurement.solution
        if found is None:
            return INTERFACE.telemetry("IdentificationSummary").reset_values()
        return {
            "Candidates": found.candidates,
            "Pivots": found.pivots,
            "Triples": found.triples,
            "Expected": found.expected,
            "Matched": int((found.stars >= 0).sum()),
        }

    def _quality(self) -> Values:
        latest, found = self._state.measurement, self._state.measurement.solution
        values = INTERFACE.telemetry("Quality").reset_values() | UNRATED
        values["Reason"] = latest.reason
        if found is not None and found.measured.light is not None:
            light = found.measured.light
            values |= {
                "Background": light.background,
                "Noise": light.noise,
                "Spread": light.background_range,
                "Blind": light.saturated,
                "Spikes": light.spikes,
                "Rejected": light.rejected,
            }
        if found is None or found.rating is None:
            return values
        self._meter.charge(f32_sqrt=3, f32_mul=3, f32_div=3, f32_atan2=1)
        matched = int((found.stars >= 0).sum())
        return values | found.rating.values(matched, found.expected)

    def _star_details(self) -> Values:
        found, database = self._state.measurement.solution, self._catalogue.database
        if found is None or not len(found.measured):
            return INTERFACE.telemetry("StarDetails").reset_values()
        number = self._state.star % len(found.measured)
        self._state.star = number + 1
        star = int(found.stars[number])
        known = database is not None and 0 <= star < len(database.numbers)
        x, y = found.measured.centroids[number]
        return {
            "StarNumber": number,
            "X": x,
            "Y": y,
            "Brightness": found.measured.brightness[number],
            "Identified": int(known),
            "Hipparcos": int(database.numbers[star]) if known and database is not None else 0,
        }

    def _catalogue_status(self) -> Values:
        store, database = self._catalogue, self._catalogue.database
        return {
            "State": store.state,
            "Stars": 0 if database is None else len(database.numbers),
            "Triangles": 0 if database is None else len(database),
            "Bytes": store.length,
            "FieldOfView": 0.0 if database is None else database.fov_deg,
            "Epoch": 0.0 if database is None else database.epoch,
            "Loads": store.loads & _U16,
            "Failures": store.failures & _U16,
            "Corrected": store.corrected,
            "Lost": store.lost,
            "CorrectedTotal": store.corrected_total & _U32,
            "RamErrors": store.ram_errors & _U16,
            "LoadTime": store.load_us / 1000,
        }

    def _upload_status(self) -> Values:
        upload = self._commands.upload
        return {
            "Blocks": upload.blocks,
            "BlocksReceived": upload.received,
            "NextBlock": upload.missing,
        }

    def _camera_register(self) -> Values:
        address, value = self._camera.selected_register
        return {"Address": address, "Value": value or 0, "Valid": int(value is not None)}
