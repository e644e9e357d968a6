"""CMSIS-SVD of a processor's registers, for debuggers and code generators."""

from xml.etree import ElementTree as Xml

from cubestack.firmware_model.interface.efm32gg.table import (
    Instance,
    Layout,
    Processor,
    Register,
    RegisterField,
)

WORD_BITS = 32
WORD_BYTES = 4


def svd(tables: Processor) -> str:
    """Text of the document; further instances derive from the first."""
    root = Xml.Element(
        "device",
        {
            "schemaVersion": "1.3",
            "xmlns:xs": "http://www.w3.org/2001/XMLSchema-instance",
            "xs:noNamespaceSchemaLocation": "CMSIS-SVD.xsd",
        },
    )
    _texts(root, name=tables.name, version="1", description=f"{tables.name}, as it is emulated")
    _texts(root, addressUnitBits=8, width=WORD_BITS, size=WORD_BITS)
    peripherals = Xml.SubElement(root, "peripherals")
    for layout in tables.layouts:
        for instance in layout.instances:
            _peripheral(peripherals, layout, instance)
    Xml.indent(root)
    return Xml.tostring(root, "unicode", xml_declaration=True) + "\n"


def _peripheral(parent: Xml.Element, layout: Layout, instance: Instance) -> None:
    first = layout.instances[0]
    own = Xml.SubElement(parent, "peripheral")
    if instance is not first:
        own.set("derivedFrom", first.name)
    _texts(own, name=instance.name, description=layout.title, baseAddress=f"{instance.base:#010x}")
    end = max((register.offset for register in layout.registers), default=0) + WORD_BYTES
    _texts(Xml.SubElement(own, "addressBlock"), offset=0, size=f"{end:#x}", usage="registers")
    for name, number in instance.interrupts.items():
        unique = name if name.startswith(instance.name) else f"{instance.name}_{name}"
        _texts(Xml.SubElement(own, "interrupt"), name=unique, value=number)
    if instance is first and layout.registers:
        registers = Xml.SubElement(own, "registers")
        for register in layout.registers:
            _register(registers, register)


def _register(parent: Xml.Element, register: Register) -> None:
    own = Xml.SubElement(parent, "register")
    kept = "" if register.modelled else "; the emulator only keeps it"
    _texts(own, name=register.name, description=f"{register.name}{kept}")
    _texts(own, addressOffset=f"{register.offset:#x}", size=WORD_BITS)
    _texts(own, access=_access(bool(register.readable), bool(register.writable)))
    _texts(own, resetValue=f"{register.reset:#010x}")
    if register.action:
        _texts(own, readAction="modifyExternal")
    named = [field for field in register.fields if field.name]
    if named:
        fields = Xml.SubElement(own, "fields")
        for field in named:
            _field(fields, field)


def _field(parent: Xml.Element, field: RegisterField) -> None:
    own = Xml.SubElement(parent, "field")
    _texts(own, name=field.name, bitOffset=field.lsb, bitWidth=field.width)
    _texts(own, access=_access(field.readable, field.writable))


def _access(readable: bool, writable: bool) -> str:
    if readable and writable:
        return "read-write"
    return "write-only" if writable else "read-only"


def _texts(parent: Xml.Element, **values: object) -> None:
    for tag, value in values.items():
        Xml.SubElement(parent, tag).text = str(value)
