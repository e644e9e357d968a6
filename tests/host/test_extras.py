import pytest

from cubestack.host.errors import install_command


def test_install_command_names_the_packages_of_an_extra() -> None:
    command = install_command("ground")
    assert command.startswith("pip install 'starlette>=")
    assert "uvicorn>=" in command
    assert "websockets>=" in command
    assert install_command("parquet") == "pip install pyarrow"


@pytest.mark.parametrize("quote", "'\"")
def test_install_command_accepts_both_quotes_in_metadata(
    monkeypatch: pytest.MonkeyPatch, quote: str
) -> None:
    lines = [f"a>=1; extra == {quote}x{quote}", f"b; extra == {quote}xy{quote}", "c"]
    monkeypatch.setattr("cubestack.host.errors.requires", lambda _: lines)
    assert install_command("x") == "pip install 'a>=1'"
