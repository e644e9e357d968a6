"""Shell commands on a device's ports: image (download), bench (letters), raw (bytes)."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cubestack.host.errors import TargetError
from cubestack.host.pictures.images import save_picture
from cubestack.host.shell.names import CommandResult, ShellCommand, ShellError, check_count
from cubestack.host.targets import Target
from cubestack.host.transport.streams import READ_BYTES, read_answer

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

RAW_TIMEOUT_S = 0.3
"""Silence that ends the answer to raw bytes."""

LETTER_TIMEOUT_S = 10.0
SHORT_ANSWER = 8
"""Longest shown answer to a bench letter."""

IMAGE = "image FILE.png [SOURCE]"
BENCH = "bench LETTER"
RAW = "raw HEX ..."


@dataclass
class PortCommands:
    """The commands on one target; the caller closes it."""

    target: Target

    def commands(self) -> list[ShellCommand]:
        return [
            ShellCommand(IMAGE, "download the image into a new file", self._image),
            ShellCommand(BENCH, "send a letter of the bench protocol", self._bench),
            ShellCommand(RAW, "send bytes, show the answer", self._raw),
        ]

    def _image(self, words: list[str]) -> CommandResult:
        check_count(IMAGE, words, 1, 2)
        path = Path(words[0])
        if path.suffix.lower() != ".png":
            raise ShellError(f"image: {path} must end in .png")
        if path.exists():
            raise ShellError(f"image: {path} exists; choose another name")
        picture = self._download(words[1] if len(words) > 1 else None)
        save_picture(picture, path)
        rows, columns = picture.shape
        data = {"file": str(path), "columns": columns, "rows": rows}
        return CommandResult([("", f"{path}: {columns} x {rows}")], data)

    def _download(self, source: str | None) -> "NDArray[np.uint8]":
        """The image in memory, or in ``source``; raises TargetError if it sends none."""
        device, name = self.target.device, self.target.interface.name
        if device is None:
            raise TargetError(f"image: {name} sends no picture")
        client = device.client(self.target.node)
        known = client.picture_sources
        if source is not None and not known:
            raise TargetError(f"image: {name} sends no picture {source!r}")
        if source is not None and source.lower() not in known:
            raise TargetError(f"image: no memory {source!r}; known: {', '.join(known)}")
        try:
            return client.picture(source and source.lower())
        except TargetError as error:
            raise TargetError(f"image: {error}") from None

    def _bench(self, words: list[str]) -> CommandResult:
        check_count(BENCH, words, 1, 1)
        protocol, line = self.target.interface.service_port, self.target.service_port
        if protocol is None:
            raise ShellError(f"bench: {self.target.interface.name} has no bench protocol")
        if line is None:
            raise ShellError("bench: no line with the bench protocol is open: give --bench TARGET")
        wanted = words[0].encode("utf-8")
        letter = protocol.find(wanted[0]) if len(wanted) == 1 else None
        if letter is None:
            known = ", ".join(f"{known.letter} ({known.name})" for known in protocol.letters)
            raise ShellError(f"bench: no letter {words[0]!r}; known: {known}")
        line.write(letter.request)
        answer = read_answer(line, letter.length, LETTER_TIMEOUT_S)
        whole = len(answer) == letter.length
        shown = whole and len(answer) <= SHORT_ANSWER
        text = repr(answer.decode("latin-1")) if shown else f"{len(answer)} bytes"
        note = "" if whole else f" of {letter.length}"
        return CommandResult(
            [(letter.name, text + note)], {"letter": letter.letter, "answer": answer.hex()}
        )

    def _raw(self, words: list[str]) -> CommandResult:
        line = self.target.line
        if line is None:
            raise ShellError(f"raw: {self.target.name} is no serial line")
        try:
            data = bytes.fromhex("".join(words))
        except ValueError:
            raise ShellError(f"raw: {' '.join(words)!r} is not hexadecimal bytes") from None
        if not data:
            raise ShellError(f"usage: {RAW}")
        line.write(data)
        answer = b"".join(iter(lambda: line.read(READ_BYTES, RAW_TIMEOUT_S), b""))
        return CommandResult([("", answer.hex(" ") or "(nothing)")], {"answer": answer.hex()})
