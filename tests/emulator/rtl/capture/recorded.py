"""Captures made from an engine: what a logic analyser would record of the same pins."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.capture.replay import bus_of
from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.wiring import Wiring

FLOATING = 0x5A
"""Level of a bus that nobody drives."""


@dataclass
class Waves:
    """Levels of the pins, buses as the wires show them."""

    wiring: Wiring
    times: NDArray[np.int64]
    levels: dict[str, NDArray[np.int64]]
    widths: dict[str, int]

    def cut(self, first: int) -> "Waves":
        """From event ``first`` on."""
        levels = {name: level[first:] for name, level in self.levels.items()}
        return Waves(self.wiring, self.times[first:], levels, self.widths)


def waves(wiring: Wiring, events: Sequence[PinEvent], memory: bytes | None = None) -> Waves:
    """The pins of ``wiring`` during ``events``; ``memory`` is what its SRAMs hold before."""
    engine = make_engine(wiring)
    for own in engine.memories.values():
        own[:] = np.resize(np.frombuffer(memory or bytes(1), np.uint8), own.shape)
    pins = tuple(wiring.initial)
    driven = [event for event in events if event.pin in (*wiring.camera_pins, *wiring.mcu_pins)]
    times = np.array([event.time_ps for event in driven], np.int64)
    numbers = np.array([pins.index(event.pin) for event in driven], np.int32)
    values = np.array([event.level for event in driven], np.uint32)
    watched = tuple(wiring.widths)
    settled = engine.replay(times, pins, numbers, values, watched).astype(np.int64)
    ports = dict(zip(watched, settled.T, strict=True))
    engine.close()
    levels, widths = {}, {}
    for pin in wiring.component.pins:
        widths[str(pin)] = pin.width
        if pin.enable is None:
            levels[str(pin)] = ports[str(pin)]
            continue
        assert pin.level_out is not None
        drives = ports[pin.enable] != 0
        memory_reads = np.zeros(len(times), bool)
        for one in wiring.memories:
            if bus_of(one) == pin:
                oe, ce, we = (ports[one[name]] for name in ("OE_N", "CE_N", "WE_N"))
                memory_reads = (oe == 0) & (ce == 0) & (we == 1)
        outside = np.full(len(times), FLOATING)
        if pin.level_in and not any(bus_of(one) == pin for one in wiring.memories):
            outside = ports[pin.level_in]
        elif pin.level_in:
            outside = np.where(memory_reads, ports[pin.level_in], FLOATING)
        levels[str(pin)] = np.where(drives, ports[pin.level_out], outside)
    return Waves(wiring, times, levels, widths)


def channels(waves: Waves, without: Collection[str] = ()) -> dict[str, NDArray[np.int64]]:
    """One line per channel: ACK, SRAM_A[3]."""
    found = {}
    for name, levels in waves.levels.items():
        if name in without:
            continue
        width = waves.widths[name]
        for bit in range(width):
            found[name if width == 1 else f"{name}[{bit}]"] = levels >> bit & 1
    return found


def write_vcd(
    path: Path,
    waves: Waves,
    *,
    without: Collection[str] = (),
    jitter: Callable[[str], int] = lambda _name: 0,
    comment: str = "",
) -> Path:
    """As sigrok writes it, times in ps; ``jitter`` is added to all times of a channel."""
    lines = channels(waves, without)
    rows: list[tuple[int, int, int, str]] = []
    head = ["$timescale 1 ps $end", f"$comment {comment} $end", "$scope module libsigrok $end"]
    for number, (name, levels) in enumerate(lines.items()):
        code = f"c{number}"
        head.append(f"$var wire 1 {code} {name} $end")
        moved = np.flatnonzero(np.diff(levels, prepend=levels[0] ^ 1))
        for place in moved:
            at = int(waves.times[place]) + (jitter(name) if place else 0)
            rows.append((at, int(place), number, f"{levels[place]}{code}"))
    text = [*head, "$upscope $end", "$enddefinitions $end"]
    now = None
    for time, _, _, change in sorted(rows):
        if time != now:
            text.append(f"#{time}")
        now = time
        text.append(change)
    text.append(f"#{max(now or 0, int(waves.times[-1]))}")
    path.write_text("\n".join(text) + "\n")
    return path


def write_csv(path: Path, waves: Waves, period_ps: int, *, without: Collection[str] = ()) -> Path:
    """As sigrok-cli -O csv, sampled; the times in the file are rounded down to ns."""
    lines = channels(waves, without)
    samples = np.arange(int(waves.times[0]), int(waves.times[-1]), period_ps)
    place = np.searchsorted(waves.times, samples, side="right") - 1
    table = np.stack([levels[place] for levels in lines.values()], axis=1)
    step = period_ps // 1000
    rows = [f"{(n + 1) * step},{','.join(map(str, row))}" for n, row in enumerate(table.tolist())]
    rate = 1e12 / period_ps
    path.write_text(
        f"; CSV generated by libsigrok 0.6.0\n; Channels ({len(lines)}/{len(lines)}):"
        f" {', '.join(lines)}\n; Samplerate: {rate / 1e6:.10g} MHz\n"
        f"nanoseconds,{','.join(['logic'] * len(lines))}\n" + "\n".join(rows) + "\n"
    )
    return path
