import shutil
import subprocess
from pathlib import Path

import pytest

from cubestack.firmware_model.reference.image import (
    IMAGE,
    ImageError,
    record_of,
    reference_image,
    sha256_of,
)

ROOT = Path(__file__).parents[3]
LARGEST = 1 << 20


def test_reference_firmware_image_is_as_recorded() -> None:
    assert reference_image() == IMAGE
    assert IMAGE.stat().st_size < LARGEST


def test_rejects_an_image_that_differs_from_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / IMAGE.name
    other.write_bytes(IMAGE.read_bytes()[:-1])
    shutil.copy(IMAGE.with_suffix(".json"), other.with_suffix(".json"))
    monkeypatch.setattr("cubestack.firmware_model.reference.image.IMAGE", other)
    with pytest.raises(ImageError, match="as recorded"):
        reference_image()
    other.unlink()
    with pytest.raises(ImageError, match="make firmware"):
        reference_image()


@pytest.mark.slow
def test_sources_compile_to_the_recorded_firmware_image(tmp_path: Path) -> None:
    compiler = shutil.which("arm-none-eabi-gcc")
    if compiler is None or shutil.which("make") is None:
        pytest.skip("arm-none-eabi-gcc is not installed")
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True)
    if version.stdout.splitlines()[0] != record_of(IMAGE)["compiler"]:
        pytest.skip(f"the image was built by {record_of(IMAGE)['compiler']}")
    built = tmp_path / IMAGE.name
    folder = ROOT / "firmware_model" / "reference"
    command = ["make", "-C", str(folder), f"BUILD={tmp_path}/build", f"IMAGE={built}"]
    subprocess.run(command, check=True, capture_output=True)
    assert sha256_of(built) == record_of(IMAGE)["sha256"], "run `make firmware`"
