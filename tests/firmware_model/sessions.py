"""A session of telecommands on a program: how long each takes and what of, and what the telemetry
shows in the end, beside what is on record."""

import zlib
from collections import Counter
from collections.abc import Iterable
from typing import Any

from cubestack.firmware_model.mcu.costs import Meter

from .operations import as_on_record

NOT_COMPARED = {"Identification", "ExtendedIdentification", "SerialNumber"}
"""Telemetry with a version, which other tests check."""

Step = tuple[str, dict[str, Any]]


def as_recorded(unit: Any, name: str, steps: Iterable[Step]) -> None:
    """Send each telecommand of ``steps``, with values other than those after a reset, and let the
    program of the harness ``unit`` execute or refuse it; then request all telemetry."""
    as_on_record(f"{name}: before", unit.meter, [unit.now_us])
    for number, (command, values) in enumerate(steps):
        before, began_us = unit.meter.counts.copy(), unit.now_us
        error = unit.send(command, **values)
        unit.run()
        took = [error, unit.now_us - began_us, _number(bytes(unit.sent))]
        unit.sent.clear()
        as_on_record(f"{name}: {number:02}. {command}", _since(before, unit.meter), took)
    for message in unit.interface.telemetries:
        if message.supported and message.name not in NOT_COMPARED:
            before = unit.meter.counts.copy()
            shown = [_number(value) for value in unit.telemetry(message.name).values()]
            as_on_record(f"{name}: {message.name}", _since(before, unit.meter), shown, 1e-6)


def _since(before: Counter[str], meter: Meter) -> Meter:
    spent = Meter(meter.table)
    spent.counts = meter.counts - before
    return spent


def _number(value: Any) -> float:
    if isinstance(value, bytes | str):
        return zlib.crc32(value if isinstance(value, bytes) else value.encode())
    return float(value)
