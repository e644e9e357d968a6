"""An OpenC3 COSMOS plug-in from an interface: the files of its folder, without a gem.

Connection, packets, protocol and one screen. The target can be renamed when it is installed; COSMOS
replaces what is between ``<%`` and ``%>`` then.
"""

from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.export.answers import answers
from cubestack.host.export.cosmos.packets import ID_NAME, definitions
from cubestack.host.export.cosmos.protocol import module_name, protocol_module

#: TCP port of the connection, unless it is changed at the installation.
PORT = 5000

#: Columns of the screen.
COLUMNS = 4


def cosmos_plugin(interface: Interface) -> dict[str, str]:
    """Texts of the plug-in's files by their paths in its folder."""
    upper = interface.name.upper()
    files = {
        **{f"cmd_tlm/{name}": text for name, text in definitions(interface).items()},
        f"lib/{module_name(interface)}.py": protocol_module(interface),
        f"screens/{upper.lower()}.txt": _lines(_screen(interface)),
        "target.txt": f"LANGUAGE python\nIGNORE_PARAMETER {ID_NAME}\nIGNORE_ITEM {ID_NAME}\n",
    }
    in_target = {f"targets/{upper}/{path}": text for path, text in files.items()}
    return {"plugin.txt": _lines(_plugin(interface)), **in_target}


def _plugin(interface: Interface) -> Iterator[str]:
    upper, name = interface.name.upper(), interface.name.lower()
    target = f"<%= {name}_target_name %>"
    device, host, port = (f"<%= {name}_{what} %>" for what in ("serial_device", "host", "port"))
    yield f"# {interface.name}, interface version {interface.version}."
    yield f"# {name}_serial_device: none to connect to {name}_host."
    yield f"VARIABLE {name}_target_name {upper}"
    yield f"VARIABLE {name}_serial_device none"
    yield f"VARIABLE {name}_host host.docker.internal"
    yield f"VARIABLE {name}_port {PORT}"
    yield ""
    yield f"TARGET {upper} {target}"
    interfaces = f"INTERFACE {target}_INT openc3/interfaces"
    yield f'<% if {name}_serial_device == "none" %>'
    yield f"{interfaces}/tcpip_client_interface.py {host} {port} {port} 10.0 nil"
    yield "<% else %>"
    line = f"{device} {device} {interface.baud} NONE 1 10.0 nil"
    yield f"{interfaces}/serial_interface.py {line}"
    yield "<% end %>"
    yield f"  MAP_TARGET {target}"
    yield f"  PROTOCOL READ_WRITE {module_name(interface)}.py"


def _screen(interface: Interface) -> Iterator[str]:
    yield "SCREEN AUTO AUTO 1.0"
    yield f'TITLE "{interface.name}"'
    yield "SCROLLWINDOW 800"
    yield f"  MATRIXBYCOLUMNS {COLUMNS}"
    target = "<%= target_name %>"
    for message in answers(interface):
        packet = message.name.upper()
        yield f'    VERTICALBOX "{message.name}"'
        if message in interface.telemetries:
            yield f"""      BUTTON "Request" 'api.cmd("{target} REQUEST_{packet}")'"""
        for field in message.fields:
            if not field.type.startswith("bytes"):  # too long for a line
                yield f"      LABELVALUE {target} {packet} {field.name.upper()} WITH_UNITS 18"
        yield "    END"
    yield "  END"
    yield "END"


def _lines(lines: Iterator[str]) -> str:
    return "\n".join(lines) + "\n"
