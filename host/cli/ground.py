"""Open a page in the browser that shows and commands a device, emulated or real.

The page is served on this machine only; its address contains a token.

examples:
  cubestack ground emulated:{first}
  cubestack ground emulated:{first} emulated:{second}
  cubestack ground emulated:{first} --profile extended --scene sky.toml
  cubestack ground /dev/ttyUSB0 --device {second}
  cubestack ground /dev/ttyUSB0 --device {second} --record run.rec
  cubestack ground run.rec
  cubestack ground ./tty --device {first} --control http://127.0.0.1:8700
"""

import argparse
import signal
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_output, add_value
from cubestack.host.cli.device_options import (
    add_board_arguments,
    add_engine_arguments,
    add_line_arguments,
    given_options,
)
from cubestack.host.cli.ports import LAST_PORT
from cubestack.host.devices.registry import device_names
from cubestack.host.errors import TargetError
from cubestack.host.targets import EMULATED, FORMS, device_at, open_target
from cubestack.host.terminal import say

if TYPE_CHECKING:
    from cubestack.host.ground.session import TargetSession


LOOK_S = 0.5
"""Wall time from one look at whether it is to end to the next."""

REFUSED_S = 10.0
"""Longest wall time that the page's address waits for the devices to open."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("targets", nargs="+", metavar="TARGET", help=FORMS)
    add_line_arguments(parser)
    add_output(parser, "--record", "record the session with a device that is not emulated here")
    parser.add_argument("--scene", metavar="FILE", help="for an emulated device")
    add_value(parser, "seed", whole(None, "for an emulated device", 0))
    add_engine_arguments(parser)
    add_board_arguments(parser)
    add_value(parser, "port", whole(0, "port of the page (default: any free one)", 0, LAST_PORT))
    add_flag(parser, "--json", "print the address as a JSON object")


def run(args: argparse.Namespace) -> int:
    """Serve the page until SIGINT or SIGTERM."""
    from cubestack.host.ground.guard import Guard, new_token
    from cubestack.host.ground.page_app import page_app
    from cubestack.host.ground.serving import LOOPBACK, Serving

    ended = threading.Event()
    options = _options(args)
    _check(args, options)
    with ExitStack() as stack:
        pool = stack.enter_context(ThreadPoolExecutor(len(args.targets)))
        sessions = [pool.submit(_open, text, options, args) for text in args.targets]
        stack.callback(_close, sessions)
        token = new_token()
        serving = Serving(Guard(page_app(sessions), token), LOOPBACK, args.port)
        stack.enter_context(serving.running())
        for session in wait(sessions, REFUSED_S, FIRST_EXCEPTION).done:
            session.result()  # a wrong call is refused before the page has an address
        address = f"{serving.url}/?token={token}"
        print(f'{{"page": "{address}"}}' if args.json else f"the page: {address}", flush=True)
        for session in sessions:
            session.result()  # whatever does not open ends this
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: ended.set())
        say("Ctrl-C ends it")
        while not ended.wait(LOOK_S):  # a signal that comes just before a wait does not end it
            pass
    return 0


def _check(args: argparse.Namespace, options: Mapping[str, Any]) -> None:
    """TargetError for a device that can not be emulated, and options that are for none."""
    targets, record = args.targets, args.record
    emulated = [one.removeprefix(EMULATED) for one in targets if one.startswith(EMULATED)]
    for name in emulated:
        if name not in device_names():
            known = ", ".join(EMULATED + one for one in device_names())
            raise TargetError(f"no device {name!r} can be emulated; known: {known}")
    from cubestack.host.ground.playback import is_recording

    for text in targets:
        if not text.startswith(EMULATED) and not is_recording(text) and args.control is None:
            device_at(text, args.device)  # a control port tells its device
    if options and not emulated:
        from cubestack.host.ground.emulators import words

        raise TargetError(f"{' '.join(words(options))} is for emulated:DEVICE")
    if record is None:
        return
    if len(targets) > 1 or emulated or is_recording(targets[0]):
        raise TargetError(f"--record {record} is for one device that is not emulated here")


def _options(args: argparse.Namespace) -> dict[str, Any]:
    """Those of emulated devices that were given, by name."""
    engine = None if args.engine == "auto" else args.engine
    given = {"scene": args.scene, "seed": args.seed, "engine": engine, **given_options(args)}
    return {name: value for name, value in given.items() if value is not None}


def _open(text: str, options: Mapping[str, Any], args: argparse.Namespace) -> "TargetSession":
    from cubestack.host.ground.emulators import Emulator
    from cubestack.host.ground.playback import is_recording, open_recording
    from cubestack.host.ground.session import TargetSession
    from cubestack.host.transport.streams import Reopening, port_of

    if text.startswith(EMULATED):
        emulator = Emulator(text.removeprefix(EMULATED), options)
        with ExitStack() as stack:
            stack.callback(emulator.close)
            session = TargetSession(emulator.start(), emulator)
            stack.pop_all()
            return session
    if is_recording(text):
        target = open_recording(text)
    else:
        target = open_target(
            *(text, args.device),
            **{"service_port": args.bench, "baud": args.baud, "control": args.control},
            record=args.record,
        )
    port = None if target.line is None else port_of(target.line)
    if isinstance(port, Reopening):
        port.reopens = True
    return TargetSession(target)


def _close(sessions: "Sequence[Future[TargetSession]]") -> None:
    for session in sessions:
        if session.exception() is None:
            session.result().close()
