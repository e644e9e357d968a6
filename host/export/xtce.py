"""XTCE 1.2 (OMG, XML Telemetric and Command Exchange) from an interface.

Telemetry containers have an ID byte before the answer (``host.export.answers``), which a link puts
there, and extend an abstract one: the ID tells them apart. A command begins with its ID byte; each
telemetry frame has a command ``Request_…``.
"""

from collections.abc import Iterator
from xml.etree import ElementTree as Xml

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.export.answers import answers, requested
from cubestack.host.export.field_text import field_details


def slots(message: Message) -> Iterator[tuple[Field | None, int]]:
    """Fields and their bits, in the stream's order; None for unused bits.

    Flags, which are numbered from a byte's lowest bit, come highest first.
    """
    whole = {one.bit_offset // 8: one for one in message.fields if one.type != "bool1"}
    flags = {one.bit_offset: one for one in message.fields if one.type == "bool1"}
    at, unused = 0, 0
    while at < message.length:
        if at in whole:
            found: list[Field | None] = [whole[at]]
        else:
            found = [flags.get(8 * at + bit) for bit in range(7, -1, -1)]
        for one in found:
            if one is None:
                unused += 1
                continue
            if unused:
                yield None, unused
            unused = 0
            yield one, one.bits
        at += whole[at].bits // 8 if at in whole else 1
    if unused:
        yield None, unused


NAMESPACE = "http://www.omg.org/spec/XTCE/20180204"

LITTLE = {"byteOrder": "leastSignificantByteFirst"}

#: The container that all answers extend, and the parameter that tells them apart.
BASE, PACKET_ID = "AnyAnswer", "PacketId"


def xtce(interface: Interface) -> str:
    root = Xml.Element("SpaceSystem", {"xmlns": NAMESPACE, "name": interface.name})
    _text(root, "LongDescription", f"{interface.name}, interface version {interface.version}.")
    _telemetry(Xml.SubElement(root, "TelemetryMetaData"), answers(interface))
    _commands(Xml.SubElement(root, "CommandMetaData"), interface)
    Xml.indent(root)
    return Xml.tostring(root, "unicode", xml_declaration=True) + "\n"


def parameter(message: Message, field: Field) -> str:
    """Name of a telemetry field's parameter: names of fields are of a message, these of all."""
    return f"{message.name}_{field.name}"


def _telemetry(parent: Xml.Element, messages: tuple[Message, ...]) -> None:
    types, names, containers = (
        Xml.SubElement(parent, f"{kind}Set") for kind in ("ParameterType", "Parameter", "Container")
    )
    for bits in sorted({n for one in messages for field, n in slots(one) if field is None}):
        unused = Xml.SubElement(types, "BinaryParameterType", name=f"unused_{bits}_bits")
        _binary(unused, bits)
        _named(names, "Parameter", f"unused_{bits}", parameterTypeRef=f"unused_{bits}_bits")
    byte = _named(types, "IntegerParameterType", f"{PACKET_ID}_type", signed="false")
    Xml.SubElement(byte, "UnitSet")
    Xml.SubElement(byte, "IntegerDataEncoding", {"sizeInBits": "8", "encoding": "unsigned"})
    _named(names, "Parameter", PACKET_ID, parameterTypeRef=f"{PACKET_ID}_type")
    base = _named(containers, "SequenceContainer", BASE, abstract="true")
    Xml.SubElement(Xml.SubElement(base, "EntryList"), "ParameterRefEntry", parameterRef=PACKET_ID)
    for message in messages:
        container = _named(containers, "SequenceContainer", message.name)
        _text(container, "LongDescription", f"ID {message.id}: {message.meaning}")
        entries = Xml.SubElement(container, "EntryList")
        for field, bits in slots(message):
            name = f"unused_{bits}" if field is None else parameter(message, field)
            Xml.SubElement(entries, "ParameterRefEntry", parameterRef=name)
            if field is not None:
                _type(types, "Parameter", f"{name}_type", field)
                declared = _named(names, "Parameter", name, parameterTypeRef=f"{name}_type")
                _text(declared, "LongDescription", field_details(field))
        extended = Xml.SubElement(container, "BaseContainer", containerRef=BASE)
        criteria = Xml.SubElement(extended, "RestrictionCriteria")
        Xml.SubElement(criteria, "Comparison", parameterRef=PACKET_ID, value=str(message.id))


def _commands(parent: Xml.Element, interface: Interface) -> None:
    if any(message.fields for message in interface.telecommands):
        types = Xml.SubElement(parent, "ArgumentTypeSet")
    commands = Xml.SubElement(parent, "MetaCommandSet")
    for message in requested(interface):
        _command(commands, message, f"Request_{message.name}", f"Requests {message.name}")
    for message in interface.telecommands:
        about = f"Telecommand {message.id}: {message.meaning}"
        arguments, entries = _command(commands, message, message.name, about)
        for field, bits in slots(message):
            if field is None or arguments is None:
                zeros = "00" * -(-bits // 8)
                size = {"binaryValue": zeros, "sizeInBits": str(bits)}
                Xml.SubElement(entries, "FixedValueEntry", size)
                continue
            of_type = f"{parameter(message, field)}_type"
            _type(types, "Argument", of_type, field, limits=True)
            declared = _named(arguments, "Argument", field.name, argumentTypeRef=of_type)
            _text(declared, "LongDescription", field_details(field))
            Xml.SubElement(entries, "ArgumentRefEntry", argumentRef=field.name)


def _command(
    parent: Xml.Element, message: Message, name: str, about: str
) -> tuple[Xml.Element | None, Xml.Element]:
    """A command that begins with the message's ID: its arguments, if any, and its entries."""
    command = _named(parent, "MetaCommand", name)
    _text(command, "LongDescription", about)
    arguments = None
    if message.fields and name == message.name:
        arguments = Xml.SubElement(command, "ArgumentList")
    entries = Xml.SubElement(_named(command, "CommandContainer", name), "EntryList")
    Xml.SubElement(entries, "FixedValueEntry", binaryValue=f"{message.id:02X}", sizeInBits="8")
    return arguments, entries


def _type(parent: Xml.Element, kind: str, name: str, field: Field, limits: bool = False) -> None:
    """What goes with a field's type; ``limits`` of what a telecommand may carry."""
    scaled = field.scale != 1
    if field.type.startswith("bytes"):
        _binary(_named(parent, f"Binary{kind}Type", name), field.bits)
        return
    if field.type == "bool1":
        own = _named(parent, f"Boolean{kind}Type", name)
    elif field.choices is not None:
        own = _named(parent, f"Enumerated{kind}Type", name)
    elif field.type == "f32" or scaled:
        own = _named(parent, f"Float{kind}Type", name, sizeInBits="64" if scaled else "32")
    else:
        own = _named(parent, f"Integer{kind}Type", name, signed=str(field.type == "i16").lower())
    units = Xml.SubElement(own, "UnitSet")
    if field.unit:
        _text(units, "Unit", field.unit)
    size = {"sizeInBits": str(field.bits)}
    if field.type == "f32":
        Xml.SubElement(own, "FloatDataEncoding", size | {"encoding": "IEEE754_1985"} | LITTLE)
    else:
        sign = {"encoding": "twosComplement" if field.type == "i16" else "unsigned"}
        order = LITTLE if field.bits > 8 else {}
        encoding = Xml.SubElement(own, "IntegerDataEncoding", size | sign | order)
        if scaled:
            calibrator = Xml.SubElement(encoding, "DefaultCalibrator")
            polynomial = Xml.SubElement(calibrator, "PolynomialCalibrator")
            term = {"coefficient": repr(1 / field.scale), "exponent": "1"}
            Xml.SubElement(polynomial, "Term", term)
    if field.choices is not None:
        listed = Xml.SubElement(own, "EnumerationList")
        for choice in field.choices:
            Xml.SubElement(listed, "Enumeration", value=str(int(choice)), label=choice.name)
    elif limits and field.type != "bool1" and field.also is None:
        ends = dict(zip(("minInclusive", "maxInclusive"), field.ends, strict=True))
        given = {key: _number(field, end) for key, end in ends.items() if end is not None}
        if given:
            Xml.SubElement(Xml.SubElement(own, "ValidRangeSet"), "ValidRange", given)


def _number(field: Field, value: float) -> str:
    return repr(float(value)) if field.type == "f32" or field.scale != 1 else str(int(value))


def _binary(own: Xml.Element, bits: int) -> None:
    Xml.SubElement(own, "UnitSet")
    size = Xml.SubElement(Xml.SubElement(own, "BinaryDataEncoding"), "SizeInBits")
    _text(size, "FixedValue", str(bits))


def _named(parent: Xml.Element, tag: str, name: str, **attributes: str) -> Xml.Element:
    return Xml.SubElement(parent, tag, {"name": name, **attributes})


def _text(parent: Xml.Element, tag: str, text: str) -> None:
    Xml.SubElement(parent, tag).text = text
