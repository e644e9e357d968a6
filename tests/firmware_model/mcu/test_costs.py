import re
from collections import Counter
from dataclasses import replace

import pytest

from cubestack.firmware_model.mcu import pic18
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533, CORE_HZ, blackfin_bf533
from cubestack.firmware_model.mcu.compiled import compiled_costs
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3, cortex_m3
from cubestack.firmware_model.mcu.costs import Cost, CostError, CostTable, Meter
from cubestack.firmware_model.mcu.memory import FlashStore

from ..operations import as_on_record

TABLES = [CORTEX_M3, BLACKFIN_BF533, pic18.PIC18F45K20]
COMPILED = pic18.pic18f45k20(library="compiled")

SIMPLE = CostTable(
    "simple part",
    1000,
    {"add": Cost(3, "measured", "bench"), "loop": Cost(5, "assumed", "a guess")},
)


def test_charges_add_up_by_count_and_cost() -> None:
    meter = Meter(SIMPLE)
    meter.charge(add=2, loop=10)
    meter.charge(add=1)
    assert meter.total == 3 * 3 + 10 * 5
    assert meter.counts == {"add": 3, "loop": 10}


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)
def test_operation_costs_equal_the_recorded_ones(table: CostTable) -> None:
    """Each operation as often as it takes cycles."""
    meter = Meter(table)
    meter.charge(**table.cycles)
    as_on_record(f"prices: {table.name}", meter)


def test_take_returns_the_cycles_since_the_last_take() -> None:
    meter = Meter(SIMPLE)
    meter.charge(add=1)
    assert meter.take() == 3
    assert meter.take() == 0
    meter.charge(loop=2)
    assert meter.take() == 10
    assert meter.total == 13


def test_elapsed_charges_are_counted_but_not_taken() -> None:
    meter = Meter(SIMPLE)
    meter.charge(loop=3)
    with meter.phase("search"):
        meter.charge_elapsed(add=10)
    assert meter.counts["add"] == 10
    assert meter.phases == {"search": 30}
    assert [meter.take(), meter.take()] == [15, 0]


def test_unknown_operation_is_reported_and_not_counted() -> None:
    with pytest.raises(CostError, match=r"'f64_add' is not in the table of simple part.*add, loop"):
        Meter(SIMPLE).charge(f64_add=1)


def test_rejects_negative_counts() -> None:
    with pytest.raises(CostError, match="'add' cannot happen -1 times"):
        Meter(SIMPLE).charge(add=-1)


def test_meter_phases_split_the_total() -> None:
    meter = Meter(SIMPLE)
    with meter.phase("search"):
        meter.charge(loop=4)
        with meter.phase("centroid"):
            meter.charge(add=1)
        meter.charge(loop=1)
    with meter.phase("search"):
        meter.charge(loop=1)
    meter.charge(add=100)
    assert meter.phases == {"search": 30, "centroid": 3}
    assert meter.total == 333


def test_charge_all_equals_charging_each_phase_separately() -> None:
    phases = {"search": {"add": 4, "loop": 1}, "sort": {"loop": 3}, "none": {}}
    one, other = Meter(SIMPLE), Meter(SIMPLE)
    for meter in (one, other):
        meter.charge(add=1)
        with meter.phase("sort"):
            meter.charge(add=7)
    for name, operations in phases.items():
        with one.phase(name):
            one.charge(**operations)
    assert other.charge_all(phases, limit=one.total)
    assert vars(other) == vars(one)


def test_phases_that_do_not_fit_are_not_charged() -> None:
    meter = Meter(SIMPLE)
    meter.charge(add=1)
    assert not meter.charge_all({"search": {"add": 4}, "sort": {"loop": 3}}, limit=3 + 12 + 15 - 1)
    assert (meter.total, meter.counts, meter.phases) == (3, {"add": 1}, {})


def test_phase_ends_when_its_block_fails() -> None:
    meter = Meter(SIMPLE)
    with pytest.raises(RuntimeError, match="stop"), meter.phase("search"):
        raise RuntimeError("stop")
    meter.charge(add=1)
    assert meter.phases == {"search": 0}


@pytest.mark.parametrize(
    ("cycles", "provenance", "source", "message"),
    [
        (0, "measured", "bench", "at least 1 cycle, not 0"),
        (1, "guessed", "bench", "measured, published, fitted, assumed, not 'guessed'"),
        (1, "measured", "", "needs a source"),
    ],
)
def test_rejects_costs_without_valid_cycles_provenance_or_source(
    cycles: int, provenance: str, source: str, message: str
) -> None:
    with pytest.raises(CostError, match=message):
        Cost(cycles, provenance, source)  # type: ignore[arg-type]


def test_transfer_loop_is_the_only_fitted_cost_and_takes_404_ms() -> None:
    fitted = {n: c for n, c in CORTEX_M3.operations.items() if c.provenance == "fitted"}
    assert set(fitted) == {"transfer_byte"}
    duration = CORTEX_M3.seconds(fitted["transfer_byte"].cycles * 1024 * 512)
    assert duration == pytest.approx(0.404, abs=0.0005)


def test_cortex_m3_costs_depend_on_build_and_memory_timing() -> None:
    usual, doubles = CORTEX_M3.operations, cortex_m3(build="-O2 double").operations
    quick = cortex_m3(timing="0 flash waits, cache, bus 1-1-3-0").operations
    assert usual["f32_add"].provenance == "measured"
    assert usual["transfer_byte"] == doubles["transfer_byte"]
    assert doubles["f32_mul"].cycles > 1.5 * usual["f32_mul"].cycles
    assert usual["flash_read"].cycles - quick["flash_read"].cycles == 2
    assert quick["ram_read"] == replace(usual["ram_read"], source=quick["ram_read"].source)
    with pytest.raises(ValueError, match=r"-O9 own, .* was not measured"):
        cortex_m3(build="-O9 own")


# --- Blackfin -------------------------------------------------------------------------------------


def test_flash_read_cost_follows_the_clock_frequency() -> None:
    assert BLACKFIN_BF533.clock_hz == CORE_HZ
    # 70 ns are 9 clocks of a bus of 120 MHz, 5 of one of 60 MHz; two more frame them.
    assert BLACKFIN_BF533.operations["flash_read"].cycles == 5 * 11
    assert blackfin_bf533(clock_hz=300_000_000).operations["flash_read"].cycles == 5 * 7


@pytest.mark.parametrize("library", ["vendor", "compiled"])
def test_blackfin_costs_are_not_fitted_and_at_most_a_third_is_assumed(library: str) -> None:
    table = blackfin_bf533(library=library)
    tags = Counter(cost.provenance for cost in table.operations.values())
    assert tags["fitted"] == 0
    assert 3 * tags["assumed"] <= tags.total()
    with pytest.raises(ValueError, match="library must be vendor or compiled, not 'mine'"):
        blackfin_bf533(library="mine")


def test_vendor_functions_are_the_compiled_ones_with_the_vendors_operations() -> None:
    compiled = compiled_costs("blackfin")
    vendor, gcc = BLACKFIN_BF533.cycles, blackfin_bf533(library="compiled").cycles
    for name, calls in compiled.calls.items():
        rest = compiled.operations[name] - sum(
            count * compiled.operations[part] for part, count in calls.items()
        )
        expected = rest + sum(count * vendor[part] for part, count in calls.items())
        assert vendor[name] == pytest.approx(expected, abs=0.51)
        assert 0 < rest <= vendor[name] <= gcc[name]


def test_blackfin_costs_include_every_float_operation_of_the_cortex_m3() -> None:
    floats = {name for name in CORTEX_M3.operations if re.match("f32|i32", name)}
    assert floats <= set(BLACKFIN_BF533.operations)


# --- PIC18 ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", [pic18.PIC18F45K20, COMPILED], ids=["notes", "compiled"])
def test_pic18_costs_are_not_fitted_and_at_most_a_third_is_assumed(table: CostTable) -> None:
    tags = Counter(cost.provenance for cost in table.operations.values())
    assert tags["fitted"] == 0
    assert 3 * tags["assumed"] <= tags.total()


@pytest.mark.parametrize("table", [pic18.PIC18F45K20, COMPILED], ids=["notes", "compiled"])
def test_float_operation_costs_rise_from_convert_to_atan2(table: CostTable) -> None:
    order = ["convert", "mul", "div", "sqrt", "atan2"]
    assert [table.cycles[f"f32_{name}"] for name in order] == sorted(
        table.cycles[f"f32_{name}"] for name in order
    )
    assert table.cycles["strobe_byte"] < table.cycles["scan_byte"] < table.cycles["address_byte"]


def test_notes_are_faster_than_the_compiled_library_and_share_the_rest() -> None:
    notes = pic18.PIC18F45K20
    assert notes.operations.keys() == COMPILED.operations.keys()
    for name, cost in notes.operations.items():
        if name in pic18.notes_costs():
            assert cost.cycles < COMPILED.cycles[name], name
        else:
            assert cost == COMPILED.operations[name]


def test_compiled_costs_are_whole_cycles_of_the_data_file_with_its_source() -> None:
    found = compiled_costs("pic18")
    cost = COMPILED.operations["f32_mul"]
    assert abs(cost.cycles - found.operations["f32_mul"]) <= 0.5
    assert cost.source == "sdcc 4.2.0 #13081 (Linux) on gpsim 0.31.0, p18f26k22"
    assert replace(found, operations={"f32_mul": 0.2}).cost("f32_mul").cycles == 1


def test_pic18_clock_is_the_published_timer_formulas() -> None:
    # The timer's period at the prescaler of 256, CubeSense thesis, equation 7.4.1.
    assert pic18.PIC18F45K20.seconds(256 * 1000) == pytest.approx(1000 * 256 / 5e6)
    literal = pic18.pic18f45k20(clock="oscillator")
    assert literal.seconds(1000) == 4 * pic18.PIC18F45K20.seconds(1000)
    assert literal.operations == pic18.PIC18F45K20.operations


@pytest.mark.parametrize("wrong", [{"library": "mine"}, {"clock": "atomic"}])
def test_pic18_rejects_unknown_libraries_and_clocks(wrong: dict[str, str]) -> None:
    with pytest.raises(
        ValueError, match=r"costs are notes or compiled and the clock instruct.*not"
    ):
        pic18.pic18f45k20(**wrong)


def test_flash_pages_keep_the_last_data_and_count_writes() -> None:
    flash = FlashStore()
    data = bytearray(b"12")
    for page, contents in (("a", b"0"), ("b", b"2"), ("a", data)):
        flash.write(page, contents)
    data[0] = 0  # the page has a copy
    assert [flash.read(page) for page in "abc"] == [b"12", b"2", None]
    flash.erase("a")
    flash.erase("never written")
    assert [flash.read(page) for page in "abc"] == [None, b"2", None]
    flash.write("a", b"3")
    assert flash.read("a") == b"3"
    assert flash.writes == {"a": 3, "b": 1}
