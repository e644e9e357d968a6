from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from amaranth.hdl import Cat, Module, Signal

from cubestack.emulator.boards.cubestar import stack
from cubestack.emulator.native.compiler import find_compiler
from cubestack.hdl.blocks import frames
from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.cubesense.tops import TOPS as PAIR_TOPS
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.flow.top import tops_in
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.host.devices.registry import device
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies.cubesense import upsets as cubesense
from cubestack.host.studies.cubestar import upsets as cubestar
from cubestack.host.studies.cubestar.upsets import _state
from cubestack.host.studies.upsets import experiment
from cubestack.host.studies.upsets.sample import UpsetResult
from tests.tiers import quick

STORES = ("storing", "between")

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


def measured(
    name: str, tested: Any, board: Mapping[str, Any] | None = None, **options: Any
) -> list[UpsetResult]:
    chosen = tested.options(**options)
    results = list(tested.run(Opener(device(name), board=board or {}), chosen))
    assert len(results) == tested.count(chosen)
    return results


@pytest.fixture(scope="module")
def counters() -> list[UpsetResult]:
    return measured("cubestar", cubestar.EXPERIMENT, registers="*er.counter.row", memory_bits=1)


@pytest.mark.slow
def test_upset_experiment_hits_every_counter_bit_in_every_phase(
    counters: list[UpsetResult],
) -> None:
    hit = [(r.target, r.bit, r.phase) for r in counters if not r.memory]
    registers = [f"{part}.counter.row" for part in ("writer", "reader")]
    phases = ("idle", "storing", "between", "reading")
    assert sorted(hit) == sorted(
        (name, bit, phase) for name in registers for bit in range(9) for phase in phases
    )
    times = [result.time_s for result in counters]
    assert times == sorted(times)


@pytest.mark.slow
def test_counter_upsets_matter_only_while_counting(counters: list[UpsetResult]) -> None:
    for result in counters:
        matters = {"writer.counter.row": "storing", "reader.counter.row": "reading"}
        if result.memory:
            continue
        if result.phase == matters[result.target]:
            assert result.effect in ("picture", "timing")
        elif result.phase == "idle" or result.target == "reader.counter.row":
            assert (result.effect, result.answer) == ("nothing", "right")
    healed = sum(result.recovered in (0, 1) for result in counters)
    assert healed > len(counters) / 2


@pytest.mark.slow
def test_same_seed_gives_the_same_results() -> None:
    options = {"registers": "writer.data", "memory_bits": 0, "seed": 5}
    first, again = (measured("cubestar", cubestar.EXPERIMENT, **options) for _ in range(2))
    assert first == again
    stored = [result.effect for result in first if result.phase == "storing"]
    assert set(stored) <= {"nothing", "pixel", "timing"}
    assert "pixel" in stored


class VotedCounter(MatrixCounter):
    """Three counters that continue from the majority: an upset of one is outvoted."""

    def elaborate(self, platform: object) -> Module:
        m = Module()
        column, row = (Signal(range(size)) for size in (self._columns, self._rows))
        m.d.comb += [
            self.last_column.eq(column == self._columns - 1),
            self.last_row.eq(row == self._rows - 1),
            self.address.eq(Cat(column, row)),
        ]
        row_over = self.next_row | (self.next_column & self.last_column)
        for name, voted, clear, step in (
            ("column", column, self.clear | row_over, self.next_column),
            ("row", row, self.clear | (row_over & self.last_row), row_over),
        ):
            a, b, c = copies = [Signal(len(voted), name=f"{name}_{copy}") for copy in "abc"]
            m.d.comb += voted.eq((a & b) | (b & c) | (a & c))
            for one in copies:
                m.d[self._domain] += one.eq(voted)
                with m.If(clear):
                    m.d[self._domain] += one.eq(0)
                with m.Elif(step):
                    m.d[self._domain] += one.eq(voted + 1)
        return m


@pytest.fixture
def voted(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    kept = stack._wiring, cubestar._wiring, experiment._registers
    monkeypatch.setattr(frames, "MatrixCounter", VotedCounter)
    for cached in kept:
        cached.cache_clear()
    yield
    for cached in kept:
        cached.cache_clear()


@pytest.mark.slow
def test_triple_voted_counter_is_immune(voted: None) -> None:
    rig = replace(cubestar.EXPERIMENT.rig(cubestar.CubeStarUpsetOptions()), phases=STORES)
    tested = replace(cubestar.EXPERIMENT, rig=lambda _options: rig)
    results = measured("cubestar", tested, registers="writer.counter.*", memory_bits=0)
    assert len({result.target for result in results}) == 6
    assert {result.effect for result in results} <= {"nothing", "left over"}
    assert {result.answer for result in results} == {"right"}


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["2", "3", "two-boards"])
def test_each_layout_has_its_registers(layout: str) -> None:
    results = measured(
        *("cubestar", cubestar.EXPERIMENT),
        **{"layout": layout, "registers": "*store", "memory_bits": 1},
        **{"flux": 4.0, "cross_section": 0.25},
    )
    assert {result.phase for result in results} == {"storing", "between", "reading"}
    assert len({one.target for one in results if one.memory}) == (1 if layout == "2" else 2)
    assert {one.effect for one in results if one.phase == "storing"} - {"nothing"}
    for result in results:
        assert sum(result.phases_s.values()) == pytest.approx(result.period_s)
        assert result.hits_a_day == 24 * 60 * 60


@pytest.mark.parametrize("gateware", quick(["both-searches", "corrected"], 1))
def test_upset_experiment_covers_two_linked_fpgas(gateware: str) -> None:
    results = measured(
        *("cubesense", cubesense.EXPERIMENT),
        **{"gateware": gateware, "registers": "*_writer.ack", "memory_bits": 0},
    )
    phases = cubesense.EXPERIMENT.rig(cubesense.CubeSenseUpsetOptions()).phases
    assert {result.phase for result in results} == set(phases)
    assert {result.effect for result in results if result.phase == "idle"} == {"nothing"}
    assert {result.effect for result in results} > {"nothing"}


@pytest.mark.slow
@pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")
# With one search, the Sun's FPGA samples its pixels while it sends alone.
@pytest.mark.filterwarnings("default::cubestack.emulator.boards.gateware.GatewareNotice")
def test_upsets_of_own_gateware_of_the_pair_are_those_of_the_shipped_one(tmp_path: Path) -> None:
    """Beside the shipped FPGA of the nadir camera that it answers like, not that of the default."""
    variant = "one-search"
    (tmp_path / "sun.v").write_text(
        verilog_file("sun", tops_in(PAIR_TOPS)[f"cubesense-sun-{variant}"])
    )
    own_design = {"gateware": f"sun={tmp_path / 'sun.v'}", "answers": variant}
    shipped, own = (
        measured(
            *("cubesense", cubesense.EXPERIMENT),
            **{**design, "registers": f"sun.{inside}pix_writer.ack", "memory_bits": 0},
        )
        for design, inside in (({"gateware": variant}, ""), (own_design, "design.core."))
    )
    renamed = [replace(one, target=one.target.replace("design.core.", "")) for one in own]
    assert {one.target for one in renamed} == {"sun.pix_writer.ack"}
    assert renamed == shipped


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"registers": "writer.roww"}, r"no register is like 'writer.roww'; there are .*writer"),
        ({"memories": "flash"}, r"no memory 'flash'; there are .*SRAM, external"),
    ],
)
def test_rejects_unknown_registers_and_memories(options: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        measured("cubestar", cubestar.EXPERIMENT, **options)


@pytest.mark.slow
def test_upset_experiment_covers_firmware_memories() -> None:
    results = measured(
        *("cubestar", cubestar.EXPERIMENT, {"firmware": "reference"}),
        **{"memories": "ram,flash", "memory_bits": 2, "registers": "bank"},
    )
    assert {(one.target, one.bits) for one in results} == {
        *(("bank", 1), ("ram", 8 * (128 << 10)), ("flash", 8 * (1 << 20)))
    }
    assert {one.effect for one in results if one.memory} == {"left over"}
    assert sum(one.right for one in results) > len(results) / 2


@pytest.mark.parametrize(
    ("boards", "high", "state"),
    [
        (1, "", "idle"),
        (1, "ENABLE", "storing"),
        (1, "ENABLE RNW", "reading"),
        (2, "BOARD1_RNW", "idle"),
        (2, "BOARD1_ENABLE", "storing"),
        (2, "BOARD1_ENABLE BOARD1_RNW BOARD2_ENABLE", "storing"),
        (2, "BOARD1_RNW BOARD2_ENABLE BOARD2_RNW", "reading"),
    ],
)
def test_state_is_storing_while_any_enabled_board_stores(
    boards: int, high: str, state: str
) -> None:
    engine: Any = SimpleNamespace(
        wiring=SimpleNamespace(acknowledges=("ACK",) * boards),
        get_pin=lambda pin: pin in high.split(),
    )
    assert _state(engine) == state
