from pathlib import Path

import pytest

from cubestack.emulator.iss.image import Image, load_image
from tests.emulator.boards.efm32gg.programs import application, build


@pytest.fixture(scope="session")
def app(tmp_path_factory: pytest.TempPathFactory) -> Image:
    return load_image(str(application(tmp_path_factory.mktemp("app"))))


@pytest.fixture(scope="session")
def echo(tmp_path_factory: pytest.TempPathFactory) -> Image:
    program = Path(__file__).with_name("echo.c")
    return load_image(str(build(tmp_path_factory.mktemp("echo"), "echo", program)))
