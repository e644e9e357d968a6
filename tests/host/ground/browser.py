"""The page in a real browser."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

SOON_MS = 30_000

STARTED_MS = 120_000
"""Starting all devices takes long on a busy machine."""


@contextmanager
def station(*words: str, environment: dict[str, str] | None = None) -> Iterator[str]:
    """Runs `cubestack ground` with ``words``; yields the address of its page."""
    call = [sys.executable, "-m", "cubestack", "ground", *words, "--json"]
    pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
    with subprocess.Popen(call, stdout=pipe, stderr=nothing, env=environment) as process:
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())["page"]
        finally:
            process.send_signal(signal.SIGINT)


@contextmanager
def shown(chromium: Any, address: str, **options: Any) -> Iterator[Any]:
    """Opens ``address``; fails on script errors and on requests to other machines."""
    page = chromium.new_context(**options).new_page()
    page.set_default_timeout(SOON_MS)
    wrong = list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda one: wrong.append(one.url) if not local(one.url) else None)
    page.goto(address)
    page.wait_for_selector("#line")
    yield page
    page.context.close()
    assert not wrong, wrong


def await_devices(chromium: Any, address: str) -> None:
    page = chromium.new_context().new_page()
    page.goto(address)
    page.wait_for_selector("#line", timeout=STARTED_MS)
    page.context.close()


def local(url: str) -> bool:
    return url.startswith(("http://127.0.0.1:", "data:", "blob:"))


def look(page: Any, device: str, *, emulated: bool = True) -> None:
    """Selects a target and waits until it is shown, with its time if it is ``emulated``."""
    page.click(f"nav >> text={device}")
    page.wait_for_function(
        "([device, emulated]) => document.title.startsWith(device) &&"
        "(!emulated || document.querySelector('#time').textContent.endsWith(' s'))",
        arg=[device, emulated],
    )


def line(page: Any, words: str) -> str:
    """Runs a shell line; returns the answer on the page."""
    before = page.locator("#lines li").count()
    page.fill("#line", words)
    page.press("#line", "Enter")
    # A button's answer may come after it, and then stands before it.
    told = page.wait_for_function(
        "([words, before]) => { const told = [...document.querySelectorAll('#lines li')];"
        "return told.slice(0, told.length - before).map((one) => one.innerText)"
        ".find((text) => text.includes(words)) }",
        arg=[words, before],
    )
    return str(told.json_value())
