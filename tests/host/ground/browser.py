"""The page in a real browser."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

SOON_MS = 120_000
"""Longest wait; on a busy machine, a start or a transfer takes long."""


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
def shown(chromium: Any, address: str, *, alone: bool = False, **options: Any) -> Iterator[Any]:
    """Opens ``address``; fails on script errors and on requests to other machines.

    Pages without ``options`` share the browser's first context and its process, unless one is to be
    ``alone``: opened in a new context, a page takes twice the processor time.
    """
    own = alone or bool(options)
    context = chromium.new_context(**options) if own else chromium.contexts[0]
    if not own and not context.pages:
        context.new_page().goto(f"{address.partition('?')[0]}favicon.ico")  # keeps the process
    page = context.new_page()
    page.set_default_timeout(SOON_MS)
    wrong = list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda one: wrong.append(one.url) if not local(one.url) else None)
    page.goto(address)
    page.wait_for_selector("#take")
    try:
        yield TabbedPage(page)
    finally:
        if own:
            context.close()
        else:
            page.evaluate("localStorage.clear()")
            page.close()
    assert not wrong, wrong


class TabbedPage:
    """A page on which each call first opens the tab that has the element."""

    def __init__(self, page: Any) -> None:
        self.page = page

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.page, name)
        if name not in ACTS:
            return found

        def act(selector: str, *arguments: Any, **options: Any) -> Any:
            self.open_tab_of(selector)
            return found(selector, *arguments, **options)

        return act

    def open_tab_of(self, selector: str) -> None:
        """Opens the tab of the first element that matches, if it is in one."""
        self.page.wait_for_selector(selector.split(" >> ")[0], state="attached")
        self.page.locator(selector.split(" >> ")[0]).first.evaluate(
            "(one) => { const panel = one.closest('[role=tabpanel]');"
            "if (panel?.hidden) document.querySelector(`[aria-controls=${panel.id}]`).click();"
            "for (let up = one; up; up = up.parentElement?.closest('details:not([open])'))"
            "  if (up.tagName === 'DETAILS' && up !== one) up.open = true }"
        )


ACTS = {
    *("click", "check", "uncheck", "fill", "focus", "hover", "press", "select_option"),
    *("inner_text", "set_input_files", "wait_for_selector"),
}
"""Calls that need an element on the screen."""


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


def lives(page: Any, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Changes all messages that the server sends from now on."""

    def connect(socket: Any) -> None:
        server = socket.connect_to_server()
        server.on_message(lambda text: socket.send(json.dumps(change(json.loads(text)))))

    page.route_web_socket("**/live", connect)
    page.reload()
    page.wait_for_selector("#take")


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


def port_of(said: Iterable[str]) -> str:
    """The TCP port that an emulation announces in its output."""
    found = (re.search(r" serves on (tcp://\S+?),? ", one) for one in said)
    return next(one[1] for one in found if one)


def saved(page: Any, button: str, path: Path) -> Path:
    """Clicks a button and saves the download as ``path``."""
    with page.expect_download() as saving:
        page.click(button)
    saving.value.save_as(path)
    return path


HOSTILE = "<img src=x onerror=document.hacked=1>"

ASKED_WITH = ("type", "frame", "field", "access", "what")
"""Members that the page interprets and does not show."""

NAMED = ("currents_ma", "probes", "snapshots", "pictures", "bits")
"""Members whose keys are names of the device."""


def hostile(value: Any) -> Any:
    """``value`` with script text appended to every text and name."""
    if isinstance(value, dict):
        return {
            key: one
            if key in ASKED_WITH
            else {name + HOSTILE: hostile(each) for name, each in one.items()}
            if key in NAMED and isinstance(one, dict)
            else hostile(one)
            for key, one in value.items()
        }
    if isinstance(value, list):
        return [hostile(one) for one in value]
    return value + HOSTILE if isinstance(value, str) else value


LOOKS = [("dark", 390), ("dark", 1280), ("light", 1280), ("light", 390)]
"""Colour schemes, and widths in pixels of a telephone and of a screen."""


def check_layout(page: Any, width: int) -> None:
    """Nothing is wider than the page or covered, and all text has contrast."""
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    covered, pale = page.evaluate(COVERED), page.evaluate(PALE)
    assert not covered, covered
    assert not pale, pale


COVERED = """() => {
  const all = [...document.querySelectorAll("button, input, select, canvas, p, h1, h2, li, td")];
  const seen = all.filter((one) => one.checkVisibility() && !one.closest("#lines, .under"));
  const shown = (one) => { // without what is scrolled out of sight
    let { left, right, top, bottom } = one.getBoundingClientRect();
    for (let up = one.parentElement; up !== document.body; up = up.parentElement) {
      if (getComputedStyle(up).overflow === "visible") continue;
      const frame = up.getBoundingClientRect();
      left = Math.max(left, frame.left), right = Math.min(right, frame.right);
      top = Math.max(top, frame.top), bottom = Math.min(bottom, frame.bottom);
    }
    return { left, right, top, bottom };
  };
  const boxes = seen.map(shown);
  const meet = (a, b) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const found = [];
  seen.forEach((one, i) => seen.slice(i + 1).forEach((other, j) => {
    if (one.contains(other) || !meet(boxes[i], boxes[i + 1 + j])) return;
    found.push(`${one.outerHTML.slice(0, 60)} and ${other.outerHTML.slice(0, 60)}`);
  }));
  return found;
}"""
"""Lists elements that overlap."""

PALE = """() => {
  const numbers = (colour) => colour.match(/[0-9.]+/g).map(Number);
  const light = (colour) => numbers(colour).slice(0, 3).reduce((sum, part, i) => {
    const share = part / 255;
    const linear = share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    return sum + [0.2126, 0.7152, 0.0722][i] * linear;
  }, 0.05);
  const ground = (one) => {
    const colour = getComputedStyle(one).backgroundColor;
    return numbers(colour)[3] === 0 ? ground(one.parentElement) : colour;
  };
  const own = (one) => [...one.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
  return [...document.body.querySelectorAll("*")]
    .filter((one) => own(one) && one.checkVisibility() && !one.matches("option, :disabled"))
    .map((one) => [one, light(getComputedStyle(one).color), light(ground(one))])
    .filter(([, a, b]) => Math.max(a, b) / Math.min(a, b) < 4.5)
    .map(([one]) => one.outerHTML.slice(0, 80));
}"""
"""Lists text with less contrast than WCAG 2.2, 1.4.3, requires."""
