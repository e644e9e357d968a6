"""The register-pointer protocol: the map's registers, the picture's stream, damaged transfers."""

from dataclasses import asdict

import pytest

from cubestack.firmware_model.cubesense.links.registers import READ_AHEAD_BYTES
from cubestack.firmware_model.interface.codec.register_pointer import FILL
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from tests.tiers import quick

from ..links_harness import Links

IMAGE = REGISTERS["IMAGE"].address


@pytest.fixture
def node(node: Links) -> Links:
    node.mcu_addressing = True
    return node


def value(node: Links, name: str) -> float:
    register = REGISTERS[name]
    found = register.decode(node.read_register(register.length, register.address))
    assert not isinstance(found, bytes)
    return found


def write(node: Links, name: str, number: int) -> None:
    assert node.write_register(REGISTERS[name].address, number) == 2


def test_every_readable_register_starts_with_its_declared_value(node: Links) -> None:
    for register in REGISTERS:
        if register.readable and not register.streams:
            assert value(node, register.name) == register.field.reset, register.name


def test_write_only_register_reads_as_nothing(node: Links) -> None:
    for register in REGISTERS:
        if not register.readable:
            assert node.read_register(2, register.address) == bytes([FILL, FILL])


@pytest.mark.parametrize(
    "register", [r for r in REGISTERS if r.readable and r.writable], ids=lambda r: r.name
)
def test_written_register_reads_back_and_changes_only_that_setting(
    node: Links, register: object
) -> None:
    name = register.name  # type: ignore[attr-defined]
    before = {r.name: value(node, r.name) for r in REGISTERS if r.readable and not r.streams}
    write(node, name, 1)
    after = {r.name: value(node, r.name) for r in REGISTERS if r.readable and not r.streams}
    assert {key for key in after if after[key] != before[key]} <= {name}
    assert after[name] == 1
    if name == "IMAGE_SRAM":
        assert node.state.image_sram == codes.Sram.SRAM2
    elif name == "NADIR_SEARCH":
        assert node.telemetry("NadirSearchMode")["Search"] == 1
    else:
        camera = codes.Camera[name.split("_")[0]]
        shown = node.telemetry("Configuration")
        field = name.removeprefix(f"{camera.name}_").title().replace("_", "")
        assert shown[f"{'AutoAdjust' if field == 'Auto' else field}{camera + 1}"] == 1


def test_exposure_above_255_reads_as_255_in_one_byte(node: Links) -> None:
    node.command("CameraSettings2", Exposure=0x1F1F)
    assert value(node, "NADIR_EXPOSURE") == 255


@pytest.mark.parametrize("target", codes.Measurement)
@pytest.mark.parametrize("name", ["MEASURE", "CAPTURE"])
def test_writing_an_action_register_starts_a_measurement(
    node: Links, name: str, target: codes.Measurement
) -> None:
    write(node, name, target)
    camera, detect = target.camera, name == "MEASURE"
    pending = codes.DetectResult.PENDING if detect else codes.DetectResult.NONE_SCHEDULED
    assert value(node, f"{camera.name}_CAPTURE") == codes.CaptureResult.PENDING
    assert value(node, f"{camera.name}_DETECT") == pending
    assert node.done == []
    node.run()
    assert node.done == [("measure", camera, target.sram, detect)]
    assert value(node, f"{camera.name}_CAPTURE") == codes.CaptureResult.STORED_OWN_SRAM
    assert node.woken


def test_results_are_big_endian_and_signed(node: Links) -> None:
    for camera in codes.Camera:
        result = node.state.results[camera]
        result.x, result.y, result.points = 0x0102 + camera, -2 - camera, 28
        assert node.read_register(2, 0x40 + 8 * camera) == bytes([1, 2 + camera])
        assert node.read_register(2, 0x41 + 8 * camera) == bytes([0xFF, 0xFE - camera])
        assert value(node, f"{camera.name}_X") == (0x0102 + camera) / 100
        assert value(node, f"{camera.name}_POINTS") == 28


@pytest.mark.parametrize("selection", codes.SramSelection)
def test_over_current_flags_can_be_cleared(node: Links, selection: codes.SramSelection) -> None:
    for bits in range(4):
        node.state.over_current = {sram: bool(bits >> sram & 1) for sram in codes.Sram}
        assert value(node, "OVER_CURRENT") == bits
    write(node, "CLEAR_OVER_CURRENT", selection)
    node.run()
    cleared = codes.Sram if selection is codes.SramSelection.BOTH else [codes.Sram(selection)]
    assert node.done == [("clear", *cleared)]


def test_register_writes_out_of_range_are_ignored(node: Links) -> None:
    state = {camera: asdict(settings) for camera, settings in node.state.cameras.items()}
    for register in REGISTERS:
        for number in range(256):
            if not register.allows(number):
                assert node.write_register(register.address, number) == 2
    for address in range(256):
        if REGISTERS.at(address) is None:
            assert node.write_register(address, 1) == 2
            assert node.read_register(1) == bytes([FILL])
    assert not node.queue
    assert {camera: asdict(settings) for camera, settings in node.state.cameras.items()} == state


def test_register_write_ignores_a_search_unsupported_by_the_fpgas() -> None:
    node = Links()
    write(node, "NADIR_SEARCH", codes.NadirSearch.AROUND_SAMPLES)
    assert value(node, "NADIR_SEARCH") == codes.NadirSearch.LINES


def test_action_is_dropped_when_the_queue_is_full(node: Links) -> None:
    for _ in range(5):
        write(node, "MEASURE", codes.Measurement.SUN_SRAM1)
    write(node, "MEASURE", codes.Measurement.NADIR_SRAM2)
    assert node.state.results[codes.Camera.NADIR].capture is codes.CaptureResult.START_UP
    assert node.telemetry("CommunicationStatus")["TcmdBufferOverrun"] == 1
    node.run()
    assert len(node.done) == 4


def test_register_action_is_not_counted_as_a_telecommand(node: Links) -> None:
    node.send("CaptureOnly")
    write(node, "CLEAR_OVER_CURRENT", codes.SramSelection.BOTH)
    node.run(1)
    assert node.telemetry("TcmdProcessed") == {"LastTcmd": 21, "Processed": 1, "Error": 0}
    node.run()
    assert node.telemetry("TcmdProcessed") == {"LastTcmd": 21, "Processed": 1, "Error": 0}


def test_register_value_is_latched_when_its_address_is_written(node: Links) -> None:
    result = node.state.results[codes.Camera.SUN]
    result.x = 0x0102
    assert node.write_register(0x40) == 1
    assert node.read_register(1) == b"\x01"
    result.x = 0x0304
    assert node.read_register(3) == bytes([2, FILL, FILL])
    assert node.read_register(2, 0x40) == b"\x03\x04"


def test_register_pointer_stays_after_a_write(node: Links) -> None:
    write(node, "SUN_GAIN", 7)
    assert node.read_register(2) == bytes([7, FILL])


def test_second_data_byte_of_a_register_write_is_not_acknowledged(node: Links) -> None:
    assert node.write_register(REGISTERS["SUN_GAIN"].address, 7, 8, 9) == 2
    assert value(node, "SUN_GAIN") == 7


def test_read_without_pointer_returns_fill_bytes(node: Links) -> None:
    assert node.read_register(3) == bytes([FILL] * 3)


@pytest.mark.parametrize("sram", quick(codes.Sram, 1))
def test_image_register_is_read_in_parts_from_one_memory_read(
    node: Links, sram: codes.Sram
) -> None:
    write(node, "IMAGE_SRAM", sram)
    data = node.read_register(8192, IMAGE)
    while len(data) < codes.IMAGE_BYTES:
        data += node.read_register(min(8192, codes.IMAGE_BYTES - len(data)))
    assert data == node.pictures[sram].tobytes()
    assert node.opened == [sram]
    assert node.read == codes.IMAGE_BYTES
    assert node.read_register(3) == bytes([FILL] * 3)
    assert not node.queue


def test_image_read_ahead_is_bounded(node: Links) -> None:
    node.read_register(1, IMAGE)
    for _ in range(100):
        node.run()
    assert 1 <= node.read <= READ_AHEAD_BYTES + 1


def test_image_stream_reads_ahead_when_half_its_buffer_is_left(node: Links) -> None:
    node.write_register(IMAGE)
    node.registers.i2c_start(True)
    assert node.registers.i2c_read() is None
    node.run()
    handed_out = []
    while not node.queue:
        handed_out.append(node.registers.i2c_read())
    assert len(handed_out) == READ_AHEAD_BYTES // 2 + 1  # the last one finds a half


def test_i2c_clock_is_stretched_until_the_first_image_bytes_are_read(node: Links) -> None:
    node.write_register(IMAGE)
    node.registers.i2c_start(True)
    before = node.meter.counts["i2c_interrupt"]
    assert [node.registers.i2c_read() for _ in range(5)] == [None] * 5
    assert node.meter.counts["i2c_interrupt"] == before
    assert len(node.queue) == 1
    assert node.woken == 1  # or a program that sleeps would never fetch them
    node.run()
    assert node.registers.i2c_read() == node.pictures[0, 0]


@pytest.mark.parametrize("address", [IMAGE, 0x40, 0xFE])
def test_writing_the_pointer_ends_the_stream(node: Links, address: int) -> None:
    node.read_register(100, IMAGE)
    other = node.read_register(2, address)
    assert other == (node.pictures[0, :2].tobytes() if address == IMAGE else other)
    node.run()
    assert node.read_register(100, IMAGE) == node.pictures[0, :100].tobytes()


def test_register_pointer_move_discards_image_bytes_being_read(node: Links) -> None:
    node.write_register(IMAGE)
    node.registers.i2c_start(True)
    assert node.registers.i2c_read() is None
    moves = iter([(0x12, 1), (IMAGE,)])
    node.on_request = lambda _request: [node.write_register(*data) for data in moves]
    node.run()
    assert node.read_register(70) == node.pictures[1, :70].tobytes()


def test_capture_during_a_register_read_does_not_change_the_data(node: Links) -> None:
    data = node.read_register(1000, IMAGE)
    node.command("CaptureOnly", Sram=codes.Sram.SRAM2)
    data += node.read_register(1000)
    assert data == node.pictures[0, :2000].tobytes()
    assert len(node.opened) == 2


def test_memory_without_supply_returns_fill_bytes(node: Links) -> None:
    node.off = {codes.Sram.SRAM1}
    assert node.read_register(200, IMAGE) == bytes([FILL] * 200)
    node.off = set()
    assert node.read_register(200, IMAGE) == node.pictures[0, :200].tobytes()


def test_register_read_returns_fill_bytes_after_the_memory_is_cut_off(node: Links) -> None:
    assert node.read_register(READ_AHEAD_BYTES, IMAGE)
    node.off = {codes.Sram.SRAM1}
    data = node.read_register(500)
    assert data.endswith(bytes([FILL] * 400))


def test_register_read_and_image_download_do_not_disturb_each_other(node: Links) -> None:
    node.command("StartImageDownload", Sram=codes.Sram.SRAM2, Size=0)
    data = b""
    for number in range(2176, 2196):
        data += node.read_register(50, None if data else IMAGE)
        node.command("NextImageFrame", Frame=number)
        assert node.telemetry("ImageFrameInfo")["FrameNumber"] == number
    assert data == node.pictures[0, :1000].tobytes()
