"""OpenC3's own classes on a plug-in's folder. Runs in an environment that has ``openc3``.

    python peer.py WORK FOLDER TARGET QUESTIONS ANSWERS

``WORK`` is a function below; ``QUESTIONS`` and ``ANSWERS`` are JSON files. Bytes are hexadecimal.
"""

import json
import queue
import sys
import threading
import time
from pathlib import Path

from openc3.config.config_parser import ConfigParser
from openc3.system.system import System
from openc3.top_level import get_class_from_module
from openc3.utilities.string import filename_to_class_name, filename_to_module

BUSY_S = 30.0
ANSWER_S = 0.5  # after the protocol has had it
STREAM_S = 10.0
STREAMED = 20


def plain(value):
    return value.hex() if isinstance(value, bytes | bytearray) else value


class Plugin:
    """A plug-in as an installed target."""

    def __init__(self, folder, name):
        system = System.instance([name], str(folder / "targets"))
        self.folder, self.name, self.config = folder, name, system.packet_config
        self.commands, self.telemetry = system.commands, system.telemetry

    def command(self, name, values):
        """A command's packet; its values are checked."""
        kinds = self.config.commands[self.name][name].items
        values = {
            key: bytes.fromhex(value) if kinds[key].data_type == "BLOCK" else value
            for key, value in values.items()
        }
        return self.commands.build_cmd(self.name, name, values)

    def read(self, data):
        """The packet that these bytes are, with values and states of limits."""
        found = self.telemetry.identify(data, [self.name])
        if found is None:
            return None
        packet = found.clone()
        packet.buffer = data
        packet.check_limits(ignore_persistence=True)
        items = [item for item in packet.sorted_items if item.data_type != "DERIVED"]
        return {
            "name": packet.packet_name,
            "values": {one.name: plain(packet.read_item(one, "CONVERTED")) for one in items},
            "raw": {one.name: plain(packet.read_item(one, "RAW")) for one in items},
            "limits": {one.name: one.limits.state for one in items if one.limits.state},
            "data": bytes(data).hex(),
        }

    def interface(self):
        """As plugin.txt, whose variables are replaced, declares it."""
        made = None
        for keyword, words in ConfigParser().parse_file(str(self.folder / "plugin.txt")):
            if keyword == "INTERFACE":
                made = made_from(words[1])(*words[2:])
            elif keyword == "PROTOCOL":
                made.add_protocol(made_from(words[1]), words[2:], words[0])
        return made


def made_from(file):
    return get_class_from_module(filename_to_module(file), filename_to_class_name(file))


def parse(plugin, _):
    return {
        "warnings": plugin.config.warnings,
        "commands": sorted(plugin.config.commands[plugin.name]),
        "telemetry": sorted(plugin.config.telemetry[plugin.name]),
        "unique": [plugin.config.cmd_unique_id_mode, plugin.config.tlm_unique_id_mode],
    }


def pack(plugin, commands):
    """Buffers of commands with these values."""
    return [plugin.command(name, values).buffer.hex() for name, values in commands]


def unpack(plugin, packets):
    return [plugin.read(bytes.fromhex(one)) for one in packets]


def talk(plugin, commands):
    """What the interface reads after each command, of several sets of values, and then."""
    interface = plugin.interface()
    interface.connect()
    packets, answers = queue.Queue(), []

    def listen():
        while (packet := interface.read()) is not None:
            packets.put(plugin.read(packet.buffer))

    threading.Thread(target=listen, daemon=True).start()

    def answer_to(identifier):
        try:
            while True:  # others are of a stream, or came late
                found = packets.get(timeout=ANSWER_S)
                first, second = bytes.fromhex(found["data"])[:2]
                if identifier == (first or second):
                    return found
        except queue.Empty:
            return None

    def ask(name, values):
        until = time.monotonic() + BUSY_S
        while time.monotonic() < until:  # it may be resetting, or its buffer be full
            packet = plugin.command(name, values)
            interface.write(packet)
            answer = answer_to(packet.buffer[0])
            if answer is not None and answer["values"].get("ERROR") != "BUFFER_FULL":
                return answer
        return None

    for name, sets in commands:
        for values in sets:  # it may know a reason to refuse the first
            answer = ask(name, values)
            if answer is None or answer["values"].get("ERROR") != "BAD_PARAMETER":
                break
        answers.append(answer)
    streamed = STREAMED if commands and commands[-1][0].startswith("STREAM") else 0
    stream = [packets.get(timeout=STREAM_S) for _ in range(streamed)]
    interface.disconnect()
    return {"answers": answers, "stream": stream}


def main(work, folder, name, questions, answers):
    plugin = Plugin(Path(folder), name)
    found = globals()[work](plugin, json.loads(Path(questions).read_text()))
    Path(answers).write_text(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
