"""Paced transfers take their wire time by the wall clock.

The accuracy of single bytes depends on the machine; `cubestack bench` measures it, and
`tests/emulator/i2cdev/test_scheduler.py` tests the rules in virtual time.
"""

import sys

import pytest

from cubestack.emulator.i2cdev.scheduler import MAX_DEBT_NS
from tests.tiers import quick

from .conftest import Run

CLIENT = """
import sys, time
from smbus2 import SMBus, i2c_msg
marks = []
with SMBus(7) as bus:
    for _ in range(16):
        {}
        marks.append(time.perf_counter())
print(*(after - before for before, after in zip(marks, marks[1:])))
"""
BYTE_READS = 20
BYTES = f"for _ in range({BYTE_READS}): bus.read_byte_data(0x1A, 0x83)"
BYTES_BITS = BYTE_READS * (2 * (1 + 9 + 9) + 1)
LONG = "bus.i2c_rdwr(i2c_msg.read(0x1A, 600))"
LONG_BITS = 1 + 9 + 9 * 600 + 1
CASES = [(100_000, BYTES, BYTES_BITS), (400_000, LONG, LONG_BITS), (400_000, BYTES, BYTES_BITS)]


@pytest.mark.parametrize(
    ("hz", "calls", "bits"), quick(CASES, 1), ids=["bytes-100k", "long-400k", "bytes-400k"]
)
def test_transfers_take_their_wire_time(run: Run, hz: int, calls: str, bits: int) -> None:
    outcome = run(sys.executable, "-c", CLIENT.format(calls), options=("--hz", hz))
    assert outcome.code == 0, outcome.err
    times = sorted(map(float, outcome.out.split()))
    wire_s = bits / hz
    assert sum(times) > len(times) * wire_s - MAX_DEBT_NS / 1e9
    if calls == LONG:  # much longer than any work for it
        assert times[0] < 1.5 * wire_s
