"""Oracles: the XTCE schema and the parser space_packet_parser."""

import io
from pathlib import Path
from typing import Any

import pytest
import space_packet_parser
from lxml import etree
from space_packet_parser.exceptions import UnrecognizedPacketTypeError
from space_packet_parser.xtce.definitions import XtcePacketDefinition

from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.export.answers import answers, requested
from cubestack.host.export.xtce import BASE, NAMESPACE, PACKET_ID, parameter, xtce
from tests.host.export.frames import COUNTS, EACH, frames, same

SCHEMA = Path(space_packet_parser.__file__).parent / "xtce" / "schemas" / "SpaceSystem.xsd"

RECOGNISED = 10
"""Frames of each kind whose container is searched: the ID decides, and the search is slow."""

XML = """
<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema"
           targetNamespace="http://www.w3.org/XML/1998/namespace">
  <xs:attribute name="base" type="xs:anyURI"/>
</xs:schema>
"""


class Offline(etree.Resolver):
    def resolve(self, url: str, public: Any, context: Any) -> Any:
        return self.resolve_string(XML, context) if url.endswith("/xml.xsd") else None


@pytest.fixture(scope="module")
def schema() -> Any:
    parser = etree.XMLParser(no_network=True)
    parser.resolvers.add(Offline())
    return etree.XMLSchema(etree.parse(str(SCHEMA), parser))


@EACH
def test_xtce_is_valid(interface: Interface, schema: Any) -> None:
    document = etree.fromstring(xtce(interface).encode())
    assert schema.validate(document), schema.error_log.filter_from_errors()[:3]


@COUNTS
@EACH
def test_answers_are_told_apart_and_decode_as_ours(interface: Interface, count: int) -> None:
    definition = XtcePacketDefinition.from_xtce(io.BytesIO(xtce(interface).encode()))
    for message in answers(interface):
        for number, (data, values) in enumerate(frames(message, count)):
            if number < RECOGNISED:
                data = bytes([message.id]) + data
            root = BASE if number < RECOGNISED else message.name
            packet = definition.parse_bytes(data, root_container_name=root)
            assert packet.get(PACKET_ID, message.id) == message.id
            _check(message, packet, values)


@EACH
def test_unknown_answers_match_no_container(interface: Interface) -> None:
    definition = XtcePacketDefinition.from_xtce(io.BytesIO(xtce(interface).encode()))
    unknown = next(n for n in range(256) if n not in {one.id for one in answers(interface)})
    with pytest.raises((UnrecognizedPacketTypeError, KeyError), match=r"PKT_APID|inheritors"):
        definition.parse_bytes(bytes([unknown]) + bytes(200), root_container_name=BASE)


@COUNTS
@EACH
def test_commands_decode_to_the_values_our_codec_packs(interface: Interface, count: int) -> None:
    """The oracle reads telemetry only, so commands are given to it as containers."""
    definition = XtcePacketDefinition.from_xtce(io.BytesIO(_as_telemetry(xtce(interface))))
    requests = {f"Request_{message.name}": message.id for message in requested(interface)}
    commands = {message.name: message.id for message in interface.telecommands}
    assert set(definition.containers) == {*requests, *commands}
    for name, number in requests.items():
        packet = definition.parse_bytes(bytes([number]), root_container_name=name)
        assert [value.hex() for value in packet.values()] == [f"{number:02x}"]
    for message in interface.telecommands:
        for _, values in frames(message, count):
            sent = bytes([message.id]) + message.pack(**values)
            packet = definition.parse_bytes(sent, root_container_name=message.name)
            first, *_ = packet.values()
            assert first.hex() == f"{message.id:02x}"
            _check(message, packet, values)


def _as_telemetry(text: str) -> bytes:
    """The document with its commands as containers: arguments are parameters, of unique names."""
    space = f"{{{NAMESPACE}}}"
    old = etree.fromstring(text.encode()).find(f"{space}CommandMetaData")
    new = etree.Element(f"{space}SpaceSystem", nsmap={None: NAMESPACE}, name="Commands")
    metadata = etree.SubElement(new, f"{space}TelemetryMetaData")
    types, names, containers = (
        etree.SubElement(metadata, f"{space}{kind}Set")
        for kind in ("ParameterType", "Parameter", "Container")
    )
    for one in old.find(f"{space}ArgumentTypeSet"):
        one.tag = one.tag.replace("Argument", "Parameter")
        for ranges in one.iterfind(f"{space}ValidRangeSet"):
            one.remove(ranges)  # which a parameter's type calls otherwise
        types.append(one)
    for command in old.iter(f"{space}MetaCommand"):
        name = command.get("name")
        container = etree.SubElement(containers, f"{space}SequenceContainer", name=name)
        entries = etree.SubElement(container, f"{space}EntryList")
        given = {
            one.get("name"): one.get("argumentTypeRef") for one in command.iter(f"{space}Argument")
        }
        for place, entry in enumerate(command.find(f".//{space}EntryList")):
            argument = entry.get("argumentRef")
            own = f"{name}_{argument or place}"
            if argument is None:
                bits = entry.get("sizeInBits")
                fixed = etree.SubElement(types, f"{space}BinaryParameterType", name=f"{own}_type")
                encoding = etree.SubElement(fixed, f"{space}BinaryDataEncoding")
                size = etree.SubElement(encoding, f"{space}SizeInBits")
                etree.SubElement(size, f"{space}FixedValue").text = bits
            of_type = f"{own}_type" if argument is None else given[argument]
            etree.SubElement(names, f"{space}Parameter", name=own, parameterTypeRef=of_type)
            etree.SubElement(entries, f"{space}ParameterRefEntry", parameterRef=own)
    return bytes(etree.tostring(new))


def _check(message: Message, packet: Any, values: dict[str, Any]) -> None:
    for field in message.fields:
        theirs = packet[parameter(message, field)]
        if field.choices is not None:
            assert theirs == field.choices(values[field.name]).name
            theirs = theirs.raw_value
        assert same(field, theirs, values[field.name]), (message.name, field.name)
