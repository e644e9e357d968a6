"""Emulations that a page starts for itself: each a process of `cubestack emulate`."""

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
_STRANGE = re.compile(r"[^\w.-]+")

JsonObject = dict[str, Any]


class Emulator:
    """Emulations of one device, one after the other.

    Attributes:
        options: those of `cubestack emulate` that the one was started with which runs; by name.
    """

    def __init__(self, device: str, options: Mapping[str, Any]) -> None:
        self._device, self.options = registered(device), dict(options)
        self._running, self._folders = ExitStack(), ExitStack()
        self._first_scene: JsonObject | None = None

    def start(self) -> Target:
        """Start the first one; PortOpenError with what it said when it does not start."""
        target = self._running.enter_context(emulated(self._device.name, words(self.options)))
        self._first_scene = _scene(target)
        return target

    def restart(
        self, target: Target, options: Mapping[str, Any], files: Mapping[str, "SentFile"]
    ) -> tuple[Target, Callable[[], None]]:
        """Start another one in place of the one behind ``target``, which runs on until then.

        Scene and seed are those of the one before: the scene that its cameras see by now.

        Args:
            target: of the one that runs.
            options: of the device's board, by name; those that are left out are as usual.
            files: contents of files that options name.

        Returns:
            The new target, and what ends the one before.

        Raises:
            ValueError: for options that make no sense.
            PortOpenError: with what it said when it does not start.
        """
        chosen = self._checked(options, files)
        # To the end, as an emulation that goes back reads its files again.
        folder = Path(self._folders.enter_context(TemporaryDirectory(prefix="cubestack-")))
        for name, sent in files.items():
            chosen[name] = sent.written(folder)
        scene = _scene(target)
        if scene is not None and scene != self._first_scene:
            chosen["scene"] = str(folder / "scene.toml")
            Path(chosen["scene"]).write_text(text_of(scene), "utf-8")
        with ExitStack() as stack:
            made = stack.enter_context(emulated(self._device.name, words(chosen)))
            before, self._running = self._running, stack.pop_all()
        self.options, self._first_scene = chosen, _scene(made)
        return made, before.close

    def close(self) -> None:
        """End the one that runs, and forget all files."""
        self._running.close()
        self._folders.close()

    def rows(self, chosen: Mapping[str, str]) -> list[JsonObject]:
        """Its options for a form; ``chosen`` is what the running one says that it has."""
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
        self, options: Mapping[str, Any], files: Mapping[str, "SentFile"]
    ) -> dict[str, Any]:
        """What is to be started; scene and seed are kept."""
        check_options(self._device, {**options, **dict.fromkeys(files, "")})
        for option in self._device.all_options:
            value = options.get(option.name, option.default)
            kept = ("", *option.known, self.options.get(option.name))
            if option.is_file and value not in kept:
                raise TargetError(f"{option.name}: send the file itself, not its name")
        if self._device.switches.declared():
            profile = options.get("profile", DEFAULT_PROFILE)
            self._device.switches.of(profile, options.get("set", ""))
        kept_from = {name: self.options[name] for name in ("scene", "seed") if name in self.options}
        return kept_from | dict(options)


class SentFile:
    """A file that a browser sent."""

    def __init__(self, name: str, content: bytes, suffix: str = "") -> None:
        """``suffix`` is the address of plain bytes, as ``@0x0``, or empty; else ValueError."""
        if not _ADDRESS.fullmatch(suffix):
            raise ValueError(f"an address of plain bytes is like @0x0, not {suffix!r}")
        self._name = _STRANGE.sub("_", Path(name).name).strip(".") or "file"
        self._content, self._suffix = content, suffix

    def written(self, folder: Path) -> str:
        """What an option calls it, written into ``folder``."""
        path = folder / self._name
        path.write_bytes(self._content)
        return f"{path}{self._suffix}"


def _scene(target: Target) -> JsonObject | None:
    """The table of what its cameras see; None where that is not told."""
    controls = target.controls
    assert isinstance(controls, RemoteControls)
    if target.device is None or target.device.scene_form is None:
        return None
    try:
        found = controls.client.ask("GET", f"/devices/{controls.device}/scene")
    except (HostError, ValueError):
        return None
    return dict(found["table"])


def words(options: Mapping[str, Any]) -> list[str]:
    """Options as the command line has them; those that are None, False or empty are left out."""
    found: list[str] = []
    for name, value in options.items():
        if value is True:
            found.append(option_string(name))
        elif value is not None and value is not False and value != "":
            found += [option_string(name), str(value)]
    return found


@contextmanager
def emulated(device: str, options: Sequence[str] = ()) -> Iterator[Target]:
    """The device ``device``, emulated in a process of its own as long as the block lasts.

    Args:
        device: its name.
        options: of `cubestack emulate`.

    Raises PortOpenError with what it said when it does not start.
    """
    token = new_token()
    call = [device, *options, "--tcp", "0", "--control", "0"]
    with emulating(call, {TOKEN: token}) as said:
        control, port = _addresses(said)
        target = open_target(port, device)
        target.name = f"emulated:{device}"
        target.controls = RemoteControls(ControlClient(control, token), device)
        yield target


def _addresses(said: Iterator[str]) -> tuple[str, str]:
    """Of its control port and its first serial line."""
    control, lines = None, list[str]()
    for line in said:
        lines.append(line)
        if found := _CONTROL.search(line):
            control = found[1]
        elif control is not None and (found := _SERVES.search(line.replace(",", " "))):
            return control, found[1]
    raise PortOpenError("; ".join(lines) or "the emulation did not start")
