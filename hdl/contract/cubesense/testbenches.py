"""Tests of CubeSense's contract."""

import random
from typing import Any

from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import ODD, wait
from cubestack.hdl.contract.cubesense.bench import LATENCY, SIDES, PairBench
from cubestack.hdl.contract.cubesense.points import hit
from cubestack.hdl.contract.testing import contract_test

#: So much of an image, never a whole one.
PART = min(GEOMETRY.pixels - 1, 2 * GEOMETRY.columns)


@contract_test()
async def stores_and_reads_back(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for side in (*SIDES, *SIDES):
        await bench.shoot(side)
        hit("image", side=side, done="stored")
        await bench.read_back(side, GEOMETRY.pixels)
        hit("image", side=side, done="read")


@contract_test()
async def aborted_at_any_moment(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for side in SIDES * 3:
        camera = bench.cameras[side]
        await bench.store(side)
        camera.send(bench.rows(random.randbytes(GEOMETRY.pixels)[:-1]))
        await wait(random.randrange(2 * GEOMETRY.pixels * camera.period), ODD)
        await bench.mcu.set(1, SUNEN=1, NADEN=1)
        await Timer(LATENCY * camera.period, unit="step")
        assert not int(bench.ack(side).value), "ACK stays high"
        await camera.sent()
        await bench.standby()
        await bench.shoot(side)
        hit("image", side=side, done="aborted")


@contract_test()
async def rows_are_stored_at_their_addresses(dut: Any) -> None:
    """The first rows of a frame, which is not acknowledged."""
    bench = await PairBench.start(dut)
    for side in SIDES:
        content = random.randbytes(PART)
        await bench.store(side)
        bench.cameras[side].send(bench.rows(content))
        await bench.cameras[side].sent()
        assert not int(bench.ack(side).value), "ACK without a whole frame"
        await bench.standby()
        assert bench.srams[side].picture()[:PART] == content, f"rows of the {side} are wrong"


@contract_test()
async def outputs_rest_in_standby(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for side in SIDES:
        bench.cameras[side].send(bench.rows(random.randbytes(PART)))
    for side in SIDES:
        await bench.cameras[side].sent()
        bench.in_standby()
        assert not bench.srams[side].edges, "a write in standby"
        hit("standby", side=side)


@contract_test()
async def reads_without_a_camera(dut: Any) -> None:
    bench = await PairBench.start(dut, cameras=False)
    for side in SIDES:
        await bench.read_back(side, PART)
        hit("read", side=side, camera="stopped")


@contract_test()
async def writes_nothing_while_reading(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for side in SIDES:
        bench.cameras[side].send(bench.rows(random.randbytes(PART)))
        await bench.read_back(side, PART)
        await bench.cameras[side].sent()
        hit("read", side=side, camera="runs")
