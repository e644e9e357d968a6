from cubestack.firmware_model.interface.cameras import mlx75412

# CubeStar thesis, appendix D, typed from the text: name, first address, bytes.
PUBLISHED = {
    "MODE_SELECT": (0x8100, 1),
    "HARDWARE_FEATURES": (0x8102, 1),
    "LINEARITY": (0x840B, 21),
    "EXPOSURE_RULE": (0x8444, 2),
    "SYNC": (0x8500, 1),
    "FIRMWARE_FEATURES": (0x8502, 1),
    "CLOCKS_PER_SECOND": (0x8518, 4),
    "FRAMES_PER_SECOND": (0x851C, 2),
    "EXPOSURE": (0x8526, 2),
}


def test_every_published_register_is_declared_where_it_is() -> None:
    assert {r.name: (r.address, r.width) for r in mlx75412.REGISTERS} == PUBLISHED
    assert mlx75412.REGISTERS.i2c_address == 0b0101100
    assert mlx75412.REGISTERS.at(0x841F) is mlx75412.REGISTERS["LINEARITY"]
    assert mlx75412.REGISTERS.at(0x8420) is None


def test_published_values() -> None:
    assert mlx75412.REGISTERS["CLOCKS_PER_SECOND"].reset == 0x019BFCC0
    assert mlx75412.REGISTERS["FRAMES_PER_SECOND"].reset == 0x001E
    assert mlx75412.LONGEST_EXPOSURE.to_bytes(2, "big") == b"\x00\x02"
    assert mlx75412.SYNC_APPLY == 0x03
    mode = mlx75412.REGISTERS["MODE_SELECT"]
    assert mode.field("ENABLE").mask == 0x01
    assert mode.field("OUTPUT_DEPTH").of(0x20) == 1  # bit 5 set, bit 6 clear: 8 bits
    features = mlx75412.REGISTERS["FIRMWARE_FEATURES"]
    assert features.field("AUTOVIEW").mask == 0x80
    assert features.field("AUTO_EXPOSURE").mask == 0x20
    assert features.field("BARRIER_UPDATE").mask | features.field("AUTO_DYNAMIC_RANGE").mask == 0x50
    assert mlx75412.REGISTERS["HARDWARE_FEATURES"].field("HISTOGRAM_REMAP").mask == 0x40


def test_only_mode_select_and_sync_act_at_once() -> None:
    assert {r.name for r in mlx75412.REGISTERS if not r.needs_sync} == {"MODE_SELECT", "SYNC"}
