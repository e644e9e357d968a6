"""Look at a device in the browser, and command it: emulated here, or on a real port.

The page is served on this machine alone, at an address with a token in it.

examples:
  cubestack ground emulated:{first}
  cubestack ground emulated:{first} emulated:{second}
  cubestack ground /dev/ttyUSB0 --device {second}
  cubestack ground ./tty --device {first} --control http://127.0.0.1:8700
"""

import argparse
import signal
import threading
from contextlib import ExitStack

from cubestack.host.cli.arguments import whole
from cubestack.host.cli.ports import LAST_PORT
from cubestack.host.devices.registry import device_names
from cubestack.host.devices.remote_controls import TOKEN
from cubestack.host.devices.targets import EMULATED, FORMS, open_target
from cubestack.host.errors import TargetError
from cubestack.host.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("targets", nargs="+", metavar="TARGET", help=FORMS)
    parser.add_argument("--device", choices=device_names(), help="where a target does not tell")
    parser.add_argument("--baud", type=whole(1), help="of a serial line")
    parser.add_argument("--bench", metavar="TARGET", help="serial line with the bench protocol")
    parser.add_argument(
        "--control", metavar="URL", help=f"control port of its emulation; its token in ${TOKEN}"
    )
    parser.add_argument(
        "--port", type=whole(0, LAST_PORT), default=0, help="of the page (default: any free one)"
    )
    parser.add_argument("--json", action="store_true", help="tell the address as a JSON object")


def run(args: argparse.Namespace) -> int:
    """Serve the page until SIGINT or SIGTERM."""
    from cubestack.host.ground.desk import Desk
    from cubestack.host.ground.emulators import emulated
    from cubestack.host.ground.guard import Guard, new_token
    from cubestack.host.ground.page_app import page_app
    from cubestack.host.ground.serving import LOOPBACK, Serving

    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: ended.set())
    with ExitStack() as stack:
        desks = []
        for text in args.targets:
            if text.startswith(EMULATED):
                name = text.removeprefix(EMULATED)
                if name not in device_names():
                    known = ", ".join(EMULATED + one for one in device_names())
                    raise TargetError(f"no device {name!r} can be emulated; known: {known}")
                target = stack.enter_context(emulated(name))
            else:
                target = open_target(
                    *(text, args.device),
                    **{"service_port": args.bench, "baud": args.baud, "control": args.control},
                )
            desks.append(Desk(target))
            stack.callback(desks[-1].close)
        token = new_token()
        serving = Serving(Guard(page_app(desks), token), LOOPBACK, args.port)
        stack.enter_context(serving.running())
        address = f"{serving.url}/?token={token}"
        print(f'{{"page": "{address}"}}' if args.json else f"the page: {address}", flush=True)
        say("Ctrl-C ends it")
        ended.wait()
    return 0
