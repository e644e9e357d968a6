"""From light to grey values: charge, noise, gain, defects and quantisation of an image sensor.

Shot, dark and read noise are drawn at once, as one normal number with the variance of their sum.
`reference` is NumPy; `pixels.cpp` does the same operations in the same order in one pass, so both
are equal to the bit, on any rows and with any number of threads.
"""

import ctypes
import itertools
import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.light.library import Library, NoiseRecord, address, light_library, noise_of
from cubestack.emulator.light.noise import FrameNoise, normals_of

Light = NDArray[np.float32]
Grey = NDArray[np.uint8]
Places = NDArray[np.int64]

SEGMENT = 16
"""Pixels of a row that are computed together, or all found in a table."""

TABLE_BITS = 14
"""Highest bits of a pixel's random number, by which its grey value is found where light is dim."""

DIM = 0.002
"""Dim light in standard deviations of the noise."""

UNKNOWN = 255
"""Instead of a grey value that depends on more."""

ROUNDING = 1e-3
"""Above what rounding and the pieces of the noise's function change, in units of either."""

NOWHERE: Places = np.zeros(0, np.int64)
NO_CHARGE: Light = np.zeros(0, np.float32)


class Most(NamedTuple):
    """Largest value of each field in each segment, (rows, segments)."""

    response: Light
    dark_share: Light
    pattern: Light

    @classmethod
    def of(cls, response: Light, dark_share: Light, pattern: Light) -> "Most":
        """Of fields (rows, columns) with whole segments."""
        fields = response, dark_share, pattern
        found = [one.reshape(len(one), -1, SEGMENT).max(axis=2) for one in fields]
        for one in found:
            one.flags.writeable = False
        return cls(*found)


@dataclass(frozen=True, eq=False)
class PixelModel:
    """An image sensor in one frame. Fields have the shape (rows, columns), places are flat.

    A pixel's charge is ``light * response + dark_share * dark + hot charge``; its noise has the
    variance ``shot * charge + steady``. With it, the pixel has the value ``(charge - black) * gain
    + pattern + offset``; rounded and limited to ``full_scale``, that is multiplied by ``step`` and
    truncated.
    """

    response: Light | None = None  #: charge per light; None: 1
    dark: float = 0.0  #: charge without light
    dark_share: Light | None = None  #: of each pixel in ``dark``; None: 1
    hot: Places = field(default_factory=NOWHERE.view)  #: pixels with more charge, ascending
    hot_charge: Light = field(default_factory=NO_CHARGE.view)  #: that of each
    noise: FrameNoise | None = None
    shot: float = 1.0
    shot_of_light: bool = True  #: False, with ``response`` None: only the rest has shot noise
    steady: float = 0.0
    black: float = 0.0  #: charge that the sensor subtracts
    gain: Light | float = 1.0  #: value per charge; (2, columns): of even rows, of odd rows
    pattern: Light | None = None
    offset: float = 0.0
    #: pixels that get the mean of their neighbours in the row, ascending; never in outer columns
    repaired: Places = field(default_factory=NOWHERE.view)
    full_scale: int = 255
    step: float = 1.0
    stuck: Places = field(default_factory=NOWHERE.view)  #: pixels at 255
    most: Most | None = None  #: of the fields; None: not known, which takes longer


def grey_values(light: Light, model: PixelModel) -> Grey:
    """Grey values (rows, columns) of ``light`` (rows, columns), at least 0; C-contiguous."""
    library = light_library()
    return reference(light, model) if library is None else compiled(library, light, model)


def reference(light: Light, model: PixelModel) -> Grey:
    """The same by NumPy."""
    charge = light if model.response is None else light * model.response
    dark = np.float32(model.dark)
    charge = charge + (dark if model.dark_share is None else model.dark_share * dark)
    np.add.at(charge.reshape(-1), model.hot, model.hot_charge)
    signal = charge
    if model.noise is not None:
        sigma = charge if model.shot_of_light else charge - light
        sigma = sigma * np.float32(model.shot)
        sigma += np.float32(model.steady)
        signal = model.noise.normals(0, light.size).reshape(light.shape)
        signal *= np.sqrt(sigma, out=sigma)
        signal += charge
    signal = signal - np.float32(model.black)
    signal *= _gains(model, light.shape[1])[np.arange(len(signal)) & 1]
    if model.pattern is not None:
        signal += model.pattern
    signal += np.float32(model.offset)
    flat = signal.reshape(-1)
    flat[model.repaired] = (flat[model.repaired - 1] + flat[model.repaired + 1]) * np.float32(0.5)
    signal += np.float32(0.5)
    np.clip(signal, 0, np.float32(model.full_scale), out=signal)
    signal *= np.float32(model.step)
    grey: Grey = signal.astype(np.uint8, order="C")
    grey.reshape(-1)[model.stuck] = 255
    return grey


class ModelRecord(ctypes.Structure):
    """``PixelModel`` of pixels.cpp."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("light", "response", "dark_share", "gain")),
        *((name, ctypes.c_void_p) for name in ("pattern", "hot", "hot_charge", "repaired")),
        ("hots", ctypes.c_int64),
        ("repairs", ctypes.c_int64),
        *((name, ctypes.c_int32) for name in ("columns", "noisy", "shot_of_light")),
        *((name, ctypes.c_float) for name in ("dark", "shot", "steady", "black", "offset")),
        *((name, ctypes.c_float) for name in ("full_scale", "step", "dim")),
        ("dim_values", ctypes.c_void_p),
        *((f"most_{name}", ctypes.c_void_p) for name in Most._fields),
        ("most_gain", ctypes.c_float),
        ("noise", NoiseRecord),
    )


def compiled(
    library: Library, light: Light, model: PixelModel, rows: tuple[int, int] | None = None
) -> Grey:
    """The same by the compiled library; ``rows``: only from the first up to the second one."""
    first, end = rows or (0, len(light))
    columns = light.shape[1]
    gains = _gains(model, columns)
    in_segments = model.noise is not None and columns % SEGMENT == 0
    most = model.most._asdict() if model.most is not None and in_segments else {}
    fields = {
        "light": light,
        "response": model.response,
        "dark_share": model.dark_share,
        "gain": gains,
        "pattern": model.pattern,
        "hot": model.hot,
        "hot_charge": model.hot_charge,
        "repaired": model.repaired,
        "dim_values": _dim_values_of(model, gains) if in_segments else None,
        **{f"most_{name}": one for name, one in most.items()},
    }
    # Kept until the call has ended.
    kept = {n: None if one is None else np.ascontiguousarray(one) for n, one in fields.items()}
    record = ModelRecord(
        **{name: address(one) for name, one in kept.items()},
        hots=len(model.hot),
        repairs=len(model.repaired),
        columns=columns,
        noisy=model.noise is not None,
        shot_of_light=model.shot_of_light,
        dark=model.dark,
        shot=model.shot,
        steady=model.steady,
        black=model.black,
        offset=model.offset,
        full_scale=model.full_scale,
        step=model.step,
        dim=_dim_light(model),
        most_gain=gains.max(),
        noise=noise_of(model.noise),
    )
    grey = np.empty((end - first, columns), np.uint8)
    library.light_grey_values(ctypes.byref(record), first, end, address(grey))
    inside = model.stuck[(model.stuck >= first * columns) & (model.stuck < end * columns)]
    grey.reshape(-1)[inside - first * columns] = 255
    return grey


def _gains(model: PixelModel, columns: int) -> Light:
    """The gain of even and of odd rows, (2, columns)."""
    return np.ascontiguousarray(np.broadcast_to(np.asarray(model.gain, np.float32), (2, columns)))


def _dim_light(model: PixelModel) -> float:
    """Light up to which a pixel's grey value is taken from the table; far below its noise."""
    return DIM * math.sqrt(model.dark * model.shot + model.steady)


def _dim_values_of(model: PixelModel, gains: Light) -> Grey | None:
    """Grey values of ordinary pixels, as of ``_dim_values``; None where they have own fields."""
    if not (model.response is model.dark_share is model.pattern is None):
        return None
    charge = model.dark, model.dark + _dim_light(model)
    gain = float(gains.min()), float(gains.max())
    end = model.offset, model.full_scale, model.step
    return _dim_values(charge, model.shot, model.steady, model.black, gain, *end)


@lru_cache(maxsize=64)
def _dim_values(
    charge: tuple[float, float],
    shot: float,
    steady: float,
    black: float,
    gain: tuple[float, float],
    offset: float,
    full_scale: int,
    step: float,
) -> Grey:
    """Grey value by the highest ``TABLE_BITS`` of a pixel's number; UNKNOWN where others matter.

    Those are the number's further bits and, between the two given ones, charge and gain.
    """
    first = np.arange(1 << TABLE_BITS, dtype=np.uint32) << np.uint32(32 - TABLE_BITS)
    last = first | np.uint32((1 << (32 - TABLE_BITS)) - 1)
    normals = np.sort([normals_of(first), normals_of(last)], axis=0).astype(np.float64)
    normals += [[-ROUNDING], [ROUNDING]]
    sigmas = [math.sqrt(one * shot + steady) for one in charge]
    corners = itertools.product(normals, sigmas, charge, gain)
    signals = [(normal * sigma + one - black) * more for normal, sigma, one, more in corners]
    low, high = (
        np.floor(np.clip(signal + offset + 0.5, 0, full_scale) * step)
        for signal in (np.min(signals, axis=0) - ROUNDING, np.max(signals, axis=0) + ROUNDING)
    )
    return np.where(low == high, low, UNKNOWN).astype(np.uint8)
