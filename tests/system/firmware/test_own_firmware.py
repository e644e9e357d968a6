from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path

import pytest

import cubestack
from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.cli.main import main
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.emulation.records import start_recorder
from cubestack.host.recording.setups import emulated_setup
from tests.emulator.boards.cubestar.builds import build, needs_toolchain
from tests.emulator.iss.armv7m.thumb import Program

pytestmark = [
    needs_toolchain,
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
]


@pytest.fixture(scope="module")
def elf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("console", tmp_path_factory.mktemp("console"))


@pytest.fixture
def star(elf: Path) -> Iterator[AnyEmulated]:
    with open_device("cubestar", firmware=str(elf)) as opened:
        yield opened


def answer(star: AnyEmulated, letter: bytes, size: int = 64, timeout_s: float = 0.05) -> bytes:
    """Bytes received within ``timeout_s`` after sending a letter."""
    port = star.serial(timeout=timeout_s)
    port.write(letter)
    return port.read(size)


def board(star: AnyEmulated) -> CubeStarFirmwareBoard:
    assert isinstance(star.board, CubeStarFirmwareBoard)
    return star.board


def test_firmware_uses_serial_line_and_trace_channel(star: AnyEmulated) -> None:
    lines: list[str] = []
    star.board.connect_console(lines.append)
    port = star.serial(timeout=0.05)
    assert port.read(64) == b"boot 1\n"
    assert answer(star, b"h") == b"hello\n"
    assert answer(star, b"x") == b"?\n"
    assert lines == ["traced"]


def test_semihosting_prints_when_enabled(elf: Path) -> None:
    for on in (True, False):
        with open_device("cubestar", firmware=str(elf), semihosting=on) as star:
            lines: list[str] = []
            star.board.connect_console(lines.append)
            star.wait(0.02)
            assert answer(star, b"s") == (b"said\n" if on else b"")
            assert ("by the debugger" in lines) == on
    with pytest.raises(ValueError, match="semihosting needs own firmware"):
        open_device("cubestar", semihosting=True)


def test_firmware_reads_camera_registers(star: AnyEmulated) -> None:
    star.wait(0.02)
    board(star).camera.i2c_write(0x2C, b"\x85\x1c\x12\x34", board(star).kernel.now)
    assert answer(star, b"r") == b"%d\n" % 0x1234
    board(star).power.switch("imager", False)
    assert answer(star, b"r") == b"%d\n" % 0xFFFFFFFF


def test_firmware_measures_the_imager_current_by_adc(star: AnyEmulated) -> None:
    star.wait(0.02)
    shown = int(answer(star, b"m"))
    assert shown == pytest.approx(board(star).power.current_ma("imager"), abs=1)


def test_comparator_sees_a_latch_up_and_the_firmware_cuts_the_supply(star: AnyEmulated) -> None:
    star.wait(0.02)
    assert answer(star, b"o") == b"armed\n"
    star.wait(0.1)
    assert board(star).power.is_on("imager")
    port = star.serial(timeout=0.05)
    star.faults.inject("latch-up", target="imager")
    assert port.read(64) == b"cut\n"
    assert not board(star).power.is_on("imager")


def test_watchdog_resets_the_firmware(star: AnyEmulated) -> None:
    star.wait(0.02)
    assert answer(star, b"w", timeout_s=0.4) == b"stopped\nboot 16\n"
    assert star.board.processor.resets == 1


@pytest.mark.parametrize(
    ("target", "cause"),
    [("brown-out", 2), ("brown-out-regulated", 4), ("reset-pin", 8), ("lock-up", 32)],
)
def test_forced_resets_report_their_causes(star: AnyEmulated, target: str, cause: int) -> None:
    star.wait(0.02)
    port = star.serial(timeout=0.05)
    star.faults.inject("processor-reset", target=target)
    assert port.read(64) == b"boot %d\n" % cause


def test_hanging_program_without_a_watchdog_stays_silent(star: AnyEmulated) -> None:
    star.wait(0.02)
    star.faults.inject("processor-reset", target="hang")
    assert answer(star, b"h", timeout_s=3.0) == b""


@pytest.mark.slow
def test_polling_program_is_idle_after_a_while(star: AnyEmulated) -> None:
    star.wait(0.02)
    assert star.board.busy()  # it polls
    star.wait(6.0)
    assert not star.board.busy()
    answer(star, b"h")
    assert star.board.busy()


def test_serial_text_at_a_wrong_rate_is_not_understood(star: AnyEmulated) -> None:
    star.wait(0.02)
    port = star.board.serial()
    port._line.form = LineFormat(19200)
    port.write(b"h")
    assert b"hello" not in port.read(64, 0.05)
    port._line.form = LineFormat(57600)
    star.wait(0.05)
    port.read(64, 0.0)
    port.write(b"h")
    star.wait(0.05)
    assert port.read(64, 0.0) == b"hello\n"


def test_line_parity_follows_the_usart_registers(star: AnyEmulated) -> None:
    star.wait(0.02)
    port = star.board.serial()
    port.write(b"e")
    star.wait(0.01)
    port.read(64, 0.0)
    assert port._line.framing_errors  # parity bits where stop bits should be
    port._line.form = LineFormat(57600, parity="E")
    port.write(b"h")
    star.wait(0.05)
    assert port.read(64, 0.0) == b"hello\n"


def test_core_and_memory_upsets_never_crash_the_emulator(elf: Path) -> None:
    for seed in range(6):
        with open_device("cubestar", firmware=str(elf), seed=seed) as star:
            star.faults.inject("core-upsets", rate=5.0)
            star.faults.inject("memory-upsets", target="flash", rate=1e-2)
            star.faults.inject("memory-upsets", target="ram", rate=1e-2)
            star.wait(0.1)
            answer(star, b"h")
            assert star.faults.events > 10


def test_same_seed_repeats_the_firmware_trace(elf: Path, tmp_path: Path) -> None:
    def recorded(name: str) -> tuple[str, int, int]:
        path = tmp_path / name
        with open_device("cubestar", firmware=str(elf), seed=5) as star:
            star.faults.inject("uart-corrupt", rate=0.2)
            for letter in b"hrmxh":
                answer(star, bytes([letter]))
            machine = board(star).machine
            path.write_text("\n".join(map(str, star.faults.log)))
            return path.read_text(), machine.cycles, machine.instructions

    assert recorded("one") == recorded("two")


def test_replay_checks_the_hash_of_the_firmware(
    elf: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = tmp_path / "session.jsonl"
    program = tmp_path / "program.elf"
    program.write_bytes(elf.read_bytes())
    stream = recording.open("w", encoding="utf-8", newline="")
    with open_device("cubestar", firmware=str(program)) as star, stream:
        recorder = start_recorder(star, stream, emulated_setup(0, None))
        answer(star, b"h")
        recorder.close()
    assert main(["replay", str(recording)]) == 0
    original = program.read_bytes()
    changed = original.replace(b"boot", b"root")
    program.write_bytes(changed)
    assert main(["replay", str(recording)]) == 0  # the recording contains the program
    assert main(["replay", str(recording), "--firmware", str(program)]) == 1
    capsys.readouterr()
    inside, other = (b64encode(one).decode() for one in (original, changed))
    text = recording.read_text("utf-8")
    assert inside in text
    recording.write_text(text.replace(inside, other), "utf-8")
    assert main(["replay", str(recording)]) == 2
    assert "has the hash" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["emulate", "measure"])
def test_bad_image_prints_one_line(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "none.bin"
    path.write_bytes(b"\xff" * 100)
    options = ["--firmware", str(path), "--firmware-base", "0"]
    assert main([command, "cubestar", *options]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert error.startswith(f"cubestack {command}: {path}")
    assert "has no vector table" in error


def test_custom_firmware_rejects_a_profile(elf: Path) -> None:
    with pytest.raises(ValueError, match="no profile and no switches"):
        cubestack.open_device("cubestar", firmware=str(elf), profile="extended")


SYS_READC, SYS_EXIT_EXTENDED = 0x07, 0x20


def exits_with(code: str) -> bytes:
    """A program that exits with the status that ``code`` leaves in R0."""
    return bytes(
        Program(
            f"{code}; ldr r1, =0x20000004; str r0, [r1]; ldr r1, =0x20000000; ldr r0, =0x20026; "
            f"str r0, [r1]; ldr r0, ={SYS_EXIT_EXTENDED}; bkpt #0xAB; udf #0"
        ).image
    )


@pytest.fixture
def exiting(tmp_path: Path) -> list[str]:
    """Options for a program that exits with status 42."""
    path = tmp_path / "exits.bin"
    path.write_bytes(exits_with("movs r0, #42"))
    return ["--firmware", str(path), "--firmware-base", "0", "--semihosting"]


def test_program_waits_for_console_input_while_time_passes(tmp_path: Path) -> None:
    path = tmp_path / "reads.bin"
    path.write_bytes(exits_with(f"movs r0, #{SYS_READC}; bkpt #0xAB"))
    options = {"firmware": str(path), "firmware_base": "0", "semihosting": True}
    typed: list[bytes | None] = [None]
    statuses: list[int] = []
    with open_device("cubestar", **options) as star:
        star.board.connect_program(statuses.append, lambda _count: typed[0])
        star.wait(0.5)
        assert statuses == []
        typed[0] = b"x"
        star.wait(0.5)
        assert statuses == [ord("x")]
        star.wait(0.5)  # time passes, and the program has ended
        assert statuses == [ord("x")]


def test_exit_of_the_program_is_the_status_of_emulate(
    exiting: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pty = ["--pty", str(tmp_path / "tty"), "--pace", "fast"]
    assert main(["emulate", "cubestar", *exiting, *pty]) == 42
    said = capsys.readouterr().err
    assert "the program exited by semihosting with status 42" in said
    assert "fault" not in said  # nothing ran after the call


def test_exit_of_the_program_is_the_status_of_measure(exiting: list[str]) -> None:
    with pytest.raises(SystemExit, match=r"^42$"):
        main(["measure", "cubestar", *exiting])


def test_semihosting_root_must_be_a_folder(elf: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"none' is not a folder; create it$"):
        open_device("cubestar", firmware=str(elf), semihosting_root=str(tmp_path / "none"))
