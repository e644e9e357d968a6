"""What a routine is charged on an input, and its result, beside what is on record.

How long a measurement takes is a sum of charges, and nothing else that a routine returns shows when
one is missing. So none changes unnoticed. With the environment variable RECORD_OPERATIONS set, a
run of the tests puts on record what is charged and found now; look at the difference before you
commit it.
"""

import json
import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.mcu.costs import Meter

FILE = Path(__file__).with_suffix(".json")
RECORD = "RECORD_OPERATIONS"
Entry = dict[str, Any]


def as_on_record(
    name: str, meter: Meter, result: Sequence[float] = (), within: float = 0.0
) -> None:
    """Fail unless ``meter`` has counted what is on record under ``name``, and the numbers of
    ``result`` are those, ``within`` so much or, if that is not 0, a ten-thousandth."""
    counted = {operation: count for operation, count in sorted(meter.counts.items()) if count}
    if os.environ.get(RECORD):
        _write(name, {**counted, "result": [round(float(n), 9) for n in result]})
    entry = dict(_on_record()[name])
    expected = entry.pop("result", [])
    assert counted == entry
    part = 1e-4 if within else 0.0
    assert list(result) == pytest.approx(expected, abs=within, rel=part, nan_ok=True)


@cache
def _on_record() -> dict[str, Entry]:
    record: dict[str, Entry] = json.loads(FILE.read_text("utf-8"))
    return record


def _write(name: str, entry: Entry) -> None:
    if not entry["result"]:
        del entry["result"]
    _on_record.cache_clear()
    record = (_on_record() if FILE.exists() else {}) | {name: entry}
    lines = [f"  {json.dumps(key)}: {json.dumps(record[key])}" for key in sorted(record)]
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
    _on_record.cache_clear()
