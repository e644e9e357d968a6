import numpy as np
import pytest

from cubestack.firmware_model.cubestar.settings import SETTING_COMMANDS, Settings
from cubestack.firmware_model.interface.cubestar import INTERFACE


def changed(seed: int) -> Settings:
    """Settings with random bits in every parameter."""
    settings = Settings()
    rng = np.random.default_rng(seed)
    for name in SETTING_COMMANDS:
        message = INTERFACE.telecommand(name)
        settings.put(name, message.unpack(rng.bytes(message.length)))
    return settings


def test_they_start_with_the_declared_reset_values() -> None:
    settings = Settings()
    for name in SETTING_COMMANDS:
        assert settings.all(name) == INTERFACE.telecommand(name).reset_values()


@pytest.mark.parametrize("seed", range(20))
def test_packed_settings_come_back_bit_by_bit(seed: int) -> None:
    packed = changed(seed).pack()
    assert len(packed) == Settings.SIZE
    restored = Settings()
    restored.unpack(packed)
    assert restored.pack() == packed


def test_they_are_stored_as_the_parameter_bytes_of_the_telecommands() -> None:
    settings = changed(1)
    parts = [INTERFACE.telecommand(name).pack(**settings.all(name)) for name in SETTING_COMMANDS]
    assert settings.pack() == b"".join(parts)


def test_clearing_returns_to_the_reset_values() -> None:
    settings = changed(2)
    settings.clear()
    assert settings.pack() == Settings().pack()


def test_one_telecommand_changes_its_own_parameters_only() -> None:
    settings = Settings()
    settings.put("setPrincipalPoint", {"Cx": 1.0, "Cy": 2.0})
    assert settings.get("setPrincipalPoint", "Cx") == 1.0
    assert settings.get("setPrincipalPoint", "Cy") == 2.0
    others = [name for name in SETTING_COMMANDS if name != "setPrincipalPoint"]
    assert all(settings.all(name) == Settings().all(name) for name in others)


def test_what_is_handed_out_is_a_copy() -> None:
    settings = Settings()
    values = {"exposure": 5}
    settings.put("Exposure", values)
    values["exposure"] = 6
    settings.all("Exposure")["exposure"] = 7
    assert settings.get("Exposure", "exposure") == 5


def test_stored_settings_of_another_length_are_refused() -> None:
    with pytest.raises(ValueError, match=f"have 3 bytes, not {Settings.SIZE}"):
        Settings().unpack(b"\0\0\0")
