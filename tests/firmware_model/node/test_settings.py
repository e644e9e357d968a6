import numpy as np
import pytest

from cubestack.firmware_model.aramis.settings import SETTING_COMMANDS as ARAMIS_SETTINGS
from cubestack.firmware_model.cubestar.state import SETTING_COMMANDS as CUBESTAR_SETTINGS
from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.node.state import Settings

NODES = {CUBESTAR.name: (CUBESTAR, CUBESTAR_SETTINGS), ARAMIS.name: (ARAMIS, ARAMIS_SETTINGS)}


@pytest.fixture(params=NODES)
def node(request: pytest.FixtureRequest) -> tuple[Interface, tuple[str, ...]]:
    return NODES[request.param]


@pytest.fixture
def settings(node: tuple[Interface, tuple[str, ...]]) -> Settings:
    return Settings(*node)


def change(settings: Settings, interface: Interface, commands: tuple[str, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    for name in commands:
        message = interface.telecommand(name)
        settings.put(name, message.unpack(rng.bytes(message.length)))


def test_settings_start_with_the_declared_reset_values(node, settings: Settings) -> None:
    interface, commands = node
    for name in commands:
        assert settings.all(name) == interface.telecommand(name).reset_values()


@pytest.mark.parametrize("seed", range(20))
def test_packed_settings_round_trip(node, settings: Settings, seed: int) -> None:
    change(settings, *node, seed)
    packed = settings.pack()
    assert len(packed) == settings.size()
    restored = Settings(*node)
    restored.unpack(packed)
    assert restored.pack() == packed


def test_settings_are_stored_as_telecommand_parameter_bytes(node, settings) -> None:
    change(settings, *node, 1)
    interface, commands = node
    parts = [interface.telecommand(name).pack(**settings.all(name)) for name in commands]
    assert settings.pack() == b"".join(parts)
    assert settings.pack(commands[1]) == parts[1]
    assert settings.size(commands[1]) == len(parts[1])


def test_clearing_returns_to_the_reset_values(node, settings: Settings) -> None:
    change(settings, *node, 2)
    settings.clear()
    assert settings.pack() == Settings(*node).pack()


def test_selected_settings_are_restored_and_no_others(node, settings: Settings) -> None:
    name = node[1][0]
    change(settings, *node, 3)
    restored = Settings(*node)
    restored.unpack(settings.pack(name), name)
    assert restored.pack(name) == settings.pack(name)
    assert restored.pack(*node[1][1:]) == Settings(*node).pack(*node[1][1:])


def test_settings_copy_parameters_in_and_out() -> None:
    settings, fresh = (Settings(CUBESTAR, CUBESTAR_SETTINGS) for _ in range(2))
    values = {"exposure": 5}
    settings.put("Exposure", values)
    values["exposure"] = 6
    settings.all("Exposure")["exposure"] = 7
    assert settings.get("Exposure", "exposure") == 5
    others = [name for name in CUBESTAR_SETTINGS if name != "Exposure"]
    assert all(settings.all(name) == fresh.all(name) for name in others)


def test_rejects_stored_settings_of_another_length(settings: Settings) -> None:
    with pytest.raises(ValueError, match=f"have 3 bytes, not {settings.size()}"):
        settings.unpack(b"\0\0\0")
