"""Counters, profile, coverage and history of a program whose behaviour is known."""

import io
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.insight.observer import Edge, History, Observer
from cubestack.emulator.iss.insight.reports import memory_use, write_callgrind, write_lcov
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import RAM_BASE, Machine
from tests.emulator.iss.cross_compiler import compile_for_m3, needs_compiler

from .conftest import PS_PER_MS, run

RUN_PS = 20 * PS_PER_MS  # 200 ticks
RAM_BYTES = 128 * 1024
HEAP_BYTES = 100


@pytest.fixture
def observer(machine: Machine, symbols: Symbols) -> Observer:
    observer = Observer(machine, symbols)
    run(machine, RUN_PS)
    return observer


def address(observer: Observer, name: str) -> int:
    function = observer.symbols.function(name)
    assert function is not None
    return function.address


def calls(observer: Observer, name: str) -> Edge:
    """The only edge to a function."""
    (found,) = (edge for edge in observer.edges() if edge.callee == address(observer, name))
    return found


def value(observer: Observer, name: str) -> int:
    where = observer.symbols.variables[name].address
    return int.from_bytes(observer.machine.peek(where, 4), "little")


def self_cycles(observer: Observer, name: str) -> int:
    function = observer.symbols.function(name)
    assert function is not None
    return sum(code.cycles_of(function.address, function.end) for code in observer.codes)


def test_instruction_and_idle_cycles_add_up_to_all_cycles(observer: Observer) -> None:
    counted = sum(int(code.cycles.sum()) for code in observer.codes)
    idle = observer.figures().idle_cycles
    assert idle > 0.9 * observer.machine.cycles
    assert counted + idle == pytest.approx(observer.machine.cycles, abs=1400)


def test_calls_are_counted(observer: Observer) -> None:
    works, squares = calls(observer, "work"), calls(observer, "square")
    assert works.count == pytest.approx(value(observer, "ticks"), abs=1)
    assert squares.count == 5 * works.count == observer.count_of(address(observer, "square"))
    assert squares.cycles == self_cycles(observer, "square")
    assert works.cycles == self_cycles(observer, "work") + squares.cycles


def test_instructions_at_the_start_of_the_ram_are_counted(
    machine: Machine, symbols: Symbols
) -> None:
    observer = Observer(machine, symbols)
    machine.poke(RAM_BASE, bytes.fromhex("00bf fde7"))  # nop, and back to it
    machine.set_register("pc", RAM_BASE)
    for _ in range(5):
        machine.step()
    counts = [observer.count_of(RAM_BASE + offset) for offset in (-2, 0, 2, 4)]
    assert counts == [0, 3, 2, 0]


def test_cycles_of_an_exception_are_not_those_of_the_interrupted_function(
    observer: Observer,
) -> None:
    handler = calls(observer, "SysTick_Handler")
    assert handler.exception
    assert (handler.site, handler.count) == (15, value(observer, "ticks"))
    start = calls(observer, "main")
    assert start.cycles == self_cycles(observer, "main") + calls(observer, "work").cycles


def test_lowest_stack_pointer_is_recorded(observer: Observer) -> None:
    figures = observer.figures()
    top = observer.symbols.labels["stack_top"]
    assert figures.process_sp is None
    assert figures.main_sp is not None
    assert 32 <= top - figures.main_sp < 128


def test_observing_a_machine_does_not_change_it(machine: Machine, observer: Observer) -> None:
    other = Machine()
    assert machine.image is not None
    other.load(machine.image)
    other.reset()
    run(other, RUN_PS)
    assert (other.cycles, other.registers()) == (machine.cycles, machine.registers())
    assert (other.ram == machine.ram).all()
    other.close()


def test_profile_has_all_cycles_by_function_and_line(observer: Observer, program: Path) -> None:
    stream = io.StringIO()
    write_callgrind(observer, stream)
    text = stream.getvalue()
    counted = sum(int(code.cycles.sum()) for code in observer.codes)
    assert f"\ncmd: {program}\n" in text
    assert f"totals: {counted}\n" in text
    inside = re.sub(r"calls=.*\n.*\n", "", text)
    assert sum(int(cost) for cost in re.findall(r"^\d+ (\d+)$", inside, re.M)) == counted
    assert "(exceptions)" in text


@pytest.mark.skipif(not shutil.which("callgrind_annotate"), reason="valgrind is not installed")
def test_callgrind_reads_the_profile(observer: Observer, tmp_path: Path) -> None:
    path = tmp_path / "callgrind.out"
    with path.open("w") as stream:
        write_callgrind(observer, stream)
    command = ["callgrind_annotate", "--inclusive=yes", "--auto=no", str(path)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = {
        name: int(cost.replace(",", ""))
        for cost, name in re.findall(r"^\s*([\d,]+) \(.*?program\.c:(\w+)", output, re.M)
    }
    assert found["work"] == calls(observer, "work").cycles
    assert found["main"] == calls(observer, "main").cycles


def test_lcov_output_has_line_and_function_counts(observer: Observer, symbols: Symbols) -> None:
    stream = io.StringIO()
    write_lcov(observer, stream)
    text = stream.getvalue()
    source = Path(__file__).with_name("program.c")
    assert f"SF:{source}\n" in text
    lines = source.read_text().splitlines()
    works = calls(observer, "work").count
    assert f"FNDA:{works},work\n" in text
    assert "FNDA:0,crash\n" in text
    number = lines.index("        sum += square(i);") + 1
    assert f"DA:{number},{5 * works}\n" in text
    number = lines.index("        crash(command);".replace("crash", "    crash")) + 1
    assert f"DA:{number},0\n" in text


def test_lcov_output_of_a_program_without_lines_has_functions_by_address(
    machine: Machine, program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = Symbols(program.read_bytes())
    monkeypatch.setattr(Symbols, "_read_lines", lambda _symbols: ())
    observer = Observer(machine, bare)
    run(machine, RUN_PS)
    stream = io.StringIO()
    write_lcov(observer, stream)
    work, works = address(observer, "work"), calls(observer, "work").count
    (record,) = stream.getvalue().split("end_of_record\n")[:-1]
    assert f"FN:{work},work\n" in record
    assert f"FNDA:{works},work\n" in record
    assert f"DA:{work},{works}\n" in record
    assert f"DA:{address(observer, 'crash')},0\n" in record


def test_history_has_functions_and_exceptions_with_their_times(
    machine: Machine, symbols: Symbols
) -> None:
    observer = Observer(machine, symbols)
    history = History(observer, {})
    run(machine, PS_PER_MS)
    changes = list(history.take())
    assert [time for time, _, _ in changes] == sorted(time for time, _, _ in changes)
    names = [value for _, variable, value in changes if variable == "function"]
    assert names[:6] == ["Reset_Handler", "main", "work", "square", "work", "square"]
    handlers = [(time, value) for time, variable, value in changes if variable == "handler"]
    assert [value for _, value in handlers[:3]] == ["SysTick", "", "SysTick"]
    assert handlers[2][0] - handlers[0][0] == pytest.approx(PS_PER_MS / 10, rel=0.01)
    assert list(history.take()) == []


def test_run_ends_when_the_history_buffer_is_full(machine: Machine, symbols: Symbols) -> None:
    observer = Observer(machine, symbols)
    history = History(observer, {})
    while machine.now_ps < RUN_PS * 3:
        machine.run(RUN_PS * 10)
        list(machine.outbox())
    full_ps = machine.now_ps
    for _ in range(10):  # the buffer is nearly full: each run is short
        machine.run(RUN_PS * 10)
    assert machine.now_ps < full_ps + RUN_PS
    taken = [name for _, variable, name in history.take() if variable == "function"]
    assert taken.count("square") == pytest.approx(5 * taken.count("work") / 6, rel=0.01)


@needs_compiler
def test_calls_of_each_task_are_counted_on_its_own_stack(tmp_path: Path) -> None:
    """SysTick and PendSV switch three tasks in the middle of their calls."""
    folder, path = Path(__file__).parents[1] / "programs", tmp_path / "rtos.elf"
    sources = folder / "device.ld", folder / "startup.c", folder / "rtos.c", "-lgcc"
    compile_for_m3("-g", "-O0", "-ffreestanding", "-nostdlib", "-T", *sources, "-o", path)
    image = load_image(path)
    machine = Machine()
    machine.load(image)
    machine.reset()
    observer = Observer(machine, Symbols.of(image))
    run(machine, 200 * PS_PER_MS)

    def below(name: str) -> int:
        """Cycles of what a function called."""
        edges = observer.edges()
        sites = [observer.symbols.function_at(edge.site) for edge in edges]
        pairs = zip(edges, sites, strict=True)
        return sum(e.cycles for e, site in pairs if site is not None and site.name == name)

    switch = calls(observer, "PendSV_Handler")
    assert switch.count > 100
    assert switch.cycles == self_cycles(observer, "PendSV_Handler") + below("PendSV_Handler")
    printed = calls(observer, "console_hex")
    assert printed.cycles == self_cycles(observer, "console_hex") + below("console_hex")
    counted = sum(int(code.cycles.sum()) for code in observer.codes)
    assert counted + observer.figures().idle_cycles == pytest.approx(machine.cycles, abs=50_000)
    machine.close()


# -- memory use, compared with the ELF file and with bytes that the test changes --


def write(observer: Observer, address: int) -> None:
    observer.machine.ram[address - RAM_BASE] ^= 0x55


def test_flash_and_static_data_are_those_of_the_elf_file(observer: Observer, program: Path) -> None:
    elf = ELFFile(io.BytesIO(program.read_bytes()))
    sections = [part for part in elf.iter_sections() if part["sh_flags"] & 2]  # SHF_ALLOC
    in_ram = [part for part in sections if part["sh_addr"] >= RAM_BASE]
    end = max(part["sh_addr"] + part["sh_size"] for part in in_ram)
    in_flash = sum(part["sh_size"] for part in sections if part["sh_type"] == "SHT_PROGBITS")
    use = memory_use(observer)
    assert (use.flash_size, use.ram_size, use.flash) == (1 << 20, RAM_BYTES, in_flash)
    assert use.static == end - RAM_BASE
    main_sp = observer.figures().main_sp
    assert main_sp is not None
    assert use.stack == RAM_BASE + RAM_BYTES - main_sp
    assert (use.heap, use.process_stack) == (0, None)
    assert use.static + use.free + use.stack == RAM_BYTES
    assert 0 < use.stack < 256


def test_heap_ends_after_the_last_changed_byte(observer: Observer) -> None:
    before = memory_use(observer)
    assert before.static is not None
    assert before.free is not None
    for offset in (HEAP_BYTES - 1, 3):
        write(observer, RAM_BASE + before.static + offset)
    use = memory_use(observer)
    assert (use.heap, use.free) == (HEAP_BYTES, before.free - HEAP_BYTES)
    write(observer, RAM_BASE + before.static + before.free)  # the stack's lowest byte
    assert memory_use(observer) == use
    write(observer, RAM_BASE + before.static + before.free - 1)
    assert memory_use(observer).free == 0


def test_static_data_end_at_the_first_known_symbol(observer: Observer) -> None:
    labels = observer.symbols.labels
    before = labels.copy()
    end = labels.pop("end")
    try:
        use = memory_use(observer)
        assert (use.static, use.heap, use.free) == (None, None, None)
        assert use.stack is not None
        for inside, at in ((True, RAM_BASE), (True, RAM_BASE + RAM_BYTES), (False, RAM_BASE - 1)):
            labels["_ebss"] = at
            assert memory_use(observer).static == (at - RAM_BASE if inside else None)
        labels["_ebss"] = RAM_BASE + RAM_BYTES + 1
        assert memory_use(observer).static is None
        labels["_end"] = end  # preferred
        assert memory_use(observer).static == end - RAM_BASE
    finally:
        labels.clear()
        labels |= before
