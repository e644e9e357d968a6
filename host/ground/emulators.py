"""Emulations that the page starts, each a process of `cubestack emulate`."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from cubestack.host.devices.device import BoardOption
from cubestack.host.devices.registry import device as registered
from cubestack.host.emulation.emulated import check_options
from cubestack.host.emulation.process import emulating
from cubestack.host.emulation.remote_controls import TOKEN, ControlClient, RemoteControls
from cubestack.host.errors import HostError, PortOpenError, TargetError
from cubestack.host.ground.guard import new_token
from cubestack.host.ground.scenes import text_of
from cubestack.host.options import option_string
from cubestack.host.targets import Target, open_target

_CONTROL = re.compile(r"control on (\S+), token ")
_SERVES = re.compile(r" serves on (tcp://\S+) ")
_ADDRESS = re.compile(r"(@0x[0-9a-fA-F]{1,8})?")
_UNSAFE = re.compile(r"[^\w.-]+")

JsonObject = dict[str, Any]


class Emulator:
    """Starts a device's emulation, and replaces it on request.

    Attributes:
        options: of `cubestack emulate` for the running emulation, by name.
    """

    def __init__(self, device: str, options: Mapping[str, Any]) -> None:
        self._device, self.options = registered(device), dict(options)
        self._running, self._folders = ExitStack(), ExitStack()
        self._first_scene: JsonObject | None = None

    def start(self) -> Target:
        """Start the first emulation; raises PortOpenError with its output if it does not start."""
        target = self._running.enter_context(emulated(self._device.name, words(self.options)))
        self._first_scene = _scene(target)
        return target

    def restart(
        self, target: Target, options: Mapping[str, Any], files: Mapping[str, "UploadedFile"]
    ) -> tuple[Target, Callable[[], None]]:
        """Start a new emulation with the seed and the current scene of the running one.

        Args:
            target: of the running emulation.
            options: of the device's board, by name; others have their default.
            files: uploaded files by option.

        Returns:
            The new target, and a function that ends the previous emulation.

        Raises:
            ValueError: for invalid options.
            PortOpenError: with its output if it does not start.
        """
        chosen = self._checked(options, files)
        # Kept until ``close``: an emulation reads its files again to go back in time.
        folder = Path(self._folders.enter_context(TemporaryDirectory(prefix="cubestack-")))
        for name, file in files.items():
            chosen[name] = file.save(folder)
        scene = _scene(target)
        if scene is not None and scene != self._first_scene:
            chosen["scene"] = str(folder / "scene.toml")
            Path(chosen["scene"]).write_text(text_of(scene), "utf-8")
        with ExitStack() as stack:
            started = stack.enter_context(emulated(self._device.name, words(chosen)))
            before, self._running = self._running, stack.pop_all()
        self.options, self._first_scene = chosen, _scene(started)
        return started, before.close

    def close(self) -> None:
        """End the emulation and delete uploaded files."""
        self._running.close()
        self._folders.close()

    def rows(self, chosen: Mapping[str, str]) -> list[JsonObject]:
        """Its options for a form; ``chosen`` are those that the running emulation reports."""
        return [self._row(one, chosen) for one in self._device.all_options]

    def _row(self, option: BoardOption, chosen: Mapping[str, str]) -> JsonObject:
        now = self.options.get(option.name, chosen.get(option.name, option.default))
        return {
            "name": option.name,
            "help": option.meaning,
            "choices": list(option.choices),
            "known": list(option.known),
            "file": option.is_file,
            "text": bool(option.metavar),
            "default": option.default,
            "unset": option.unset,
            "now": now,
        }

    def _checked(
        self, options: Mapping[str, Any], files: Mapping[str, "UploadedFile"]
    ) -> dict[str, Any]:
        """Validated options of the new emulation, with the previous scene and seed."""
        check_options(self._device, {**options, **dict.fromkeys(files, "")})
        for option in self._device.all_options:
            value = options.get(option.name, option.default)
            kept = ("", *option.known, self.options.get(option.name))
            if option.is_file and value not in kept:
                raise TargetError(f"{option.name}: upload the file itself, not its name")
        if self._device.switches.declared():
            profile = options.get("profile", DEFAULT_PROFILE)
            self._device.switches.of(profile, options.get("set", ""))
        kept = ("scene", "seed", "engine")
        return {name: self.options[name] for name in kept if name in self.options} | dict(options)


class UploadedFile:
    """A file from the browser, for an option of the emulation."""

    def __init__(self, name: str, content: bytes, suffix: str = "") -> None:
        """``suffix`` is empty or the address of a raw binary, like ``@0x0``; else ValueError."""
        if not _ADDRESS.fullmatch(suffix):
            raise ValueError(f"the address of a raw binary must be like @0x0, not {suffix!r}")
        self._name = _UNSAFE.sub("_", Path(name).name).strip(".") or "file"
        self._content, self._suffix = content, suffix

    def save(self, folder: Path) -> str:
        """Write it into ``folder``; returns the value of the option."""
        path = folder / self._name
        path.write_bytes(self._content)
        return f"{path}{self._suffix}"


def _scene(target: Target) -> JsonObject | None:
    """The table of the current scene; None if the device can not report it."""
    controls = target.controls
    assert isinstance(controls, RemoteControls)
    if target.device is None or target.device.scene_form is None:
        return None
    try:
        return dict(controls.client.ask("GET", f"/devices/{controls.device}/scene")["table"])
    except (HostError, ValueError):
        return None


def words(options: Mapping[str, Any]) -> list[str]:
    """Options as words of the command line, without those that are None, False or empty."""
    found: list[str] = []
    for name, value in options.items():
        if value is True:
            found.append(option_string(name))
        elif value is not None and value is not False and value != "":
            found += [option_string(name), str(value)]
    return found


@contextmanager
def emulated(device: str, options: Sequence[str] = ()) -> Iterator[Target]:
    """Emulate ``device`` in its own process for the duration of the block.

    ``options`` are words of `cubestack emulate`. Raises PortOpenError with its output if it does
    not start.
    """
    token = new_token()
    call = [device, *options, "--tcp", "0", "--control", "0"]
    with emulating(call, {TOKEN: token}) as output:
        control, port = _addresses(output)
        target = open_target(port, device)
        target.name = f"emulated:{device}"
        target.controls = RemoteControls(ControlClient(control, token), device)
        yield target


def _addresses(output: Iterator[str]) -> tuple[str, str]:
    """Addresses of its control port and its first serial line."""
    control, lines = None, list[str]()
    for line in output:
        lines.append(line)
        if found := _CONTROL.search(line):
            control = found[1]
        elif control is not None and (found := _SERVES.search(line.replace(",", " "))):
            return control, found[1]
    raise PortOpenError("; ".join(lines) or "the emulation did not start")
