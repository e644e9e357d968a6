"""Oracles: the XTCE schema and the parser space_packet_parser."""

import io
from pathlib import Path
from typing import Any

import pytest
import space_packet_parser
from lxml import etree
from space_packet_parser.xtce.definitions import XtcePacketDefinition

from cubestack.firmware_model.interface.codec.message import Interface, MessageKind
from cubestack.host.export.xtce import NAMESPACE, parameter, xtce
from tests.host.export.frames import COUNTS, EACH, frames, messages, same

SCHEMA = Path(space_packet_parser.__file__).parent / "xtce" / "schemas" / "SpaceSystem.xsd"

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
def test_telemetry_values_match_the_client(interface: Interface, count: int) -> None:
    definition = XtcePacketDefinition.from_xtce(io.BytesIO(xtce(interface).encode()))
    for message in messages(interface, MessageKind.TELEMETRY):
        for data, values in frames(message, count):
            packet = definition.parse_bytes(data, root_container_name=message.name)
            for field in message.fields:
                theirs = packet[parameter(message, field)]
                if field.choices is not None:
                    assert theirs == field.choices(values[field.name]).name
                    theirs = theirs.raw_value
                assert same(field, theirs, values[field.name]), (message.name, field.name)


@EACH
def test_telecommand_entries_add_up_to_the_message(interface: Interface) -> None:
    root = etree.fromstring(xtce(interface).encode())
    names = {"x": NAMESPACE}
    bits = {
        one.getparent().get("name"): int(one.get("sizeInBits") or one.findtext(".//{*}FixedValue"))
        for one in root.iterfind(".//x:ArgumentTypeSet/*/*", names)
        if one.tag.endswith("DataEncoding")
    }
    for message in messages(interface, MessageKind.TELECOMMAND):
        command = root.find(f".//x:MetaCommand[@name='{message.name}']", names)
        types = {
            one.get("name"): one.get("argumentTypeRef")
            for one in command.iterfind("x:ArgumentList/x:Argument", names)
        }
        first, *others = command.find(".//x:EntryList", names)
        assert int(first.get("binaryValue"), 16) == message.id
        sizes = [one.get("sizeInBits") or bits[types[one.get("argumentRef")]] for one in others]
        assert sum(map(int, sizes)) == 8 * message.length
        assert set(types) == {field.name for field in message.fields}
