"""Encodings of the Cortex-M3's instructions, as templates for random programs.

Source: ARMv7-M Architecture Reference Manual (ARM DDI 0403), chapter A7.7; a template's name is the
mnemonic and the number of the encoding there. A template has fixed bits and these fields:

- ``d``, ``e``: results;
- ``n``, ``m``, ``a``: operands;
- ``p``: a register with an address of RAM, ``q``: with one of a word, ``x``: with a small index;
- ``name:bits``: any value.

Registers have 4 bits; with the suffix ``l`` 3, as low registers; ``dH`` and ``dL`` are the high
bit and the low bits of one.
"""

from collections.abc import Callable
from dataclasses import dataclass

Fields = dict[str, int]


@dataclass(frozen=True)
class Encoding:
    """One encoding."""

    name: str  #: mnemonic and number
    template: str  #: its bits
    valid: Callable[[Fields], bool] | None = None  #: whether these fields are predictable
    moves: int = 0  #: the most bytes by which write-back changes register ``p``
    in_it: bool = True  #: allowed in an IT block


def _shift_add_16() -> list[Encoding]:
    rows = {
        "MOVS T2 (LSL 0)": "000 00 00000 ml dl",
        "LSLS T1": "000 00 i:5 ml dl",
        "LSRS T1": "000 01 i:5 ml dl",
        "ASRS T1": "000 10 i:5 ml dl",
        "ADDS reg T1": "0001100 ml nl dl",
        "SUBS reg T1": "0001101 ml nl dl",
        "ADDS imm T1": "0001110 i:3 nl dl",
        "SUBS imm T1": "0001111 i:3 nl dl",
        "MOVS imm T1": "00100 dl i:8",
        "CMP imm T1": "00101 nl i:8",
        "ADDS imm T2": "00110 dl i:8",
        "SUBS imm T2": "00111 dl i:8",
        "ADD reg T2": "01000100 dH m dL",
        "MOV reg T1": "01000110 dH m dL",
        "ADR T1": "10100 dl i:8",
        "ADD SP imm T1": "10101 dl i:8",
        "SXTH T1": "1011001000 ml dl",
        "SXTB T1": "1011001001 ml dl",
        "UXTH T1": "1011001010 ml dl",
        "UXTB T1": "1011001011 ml dl",
        "REV T1": "1011101000 ml dl",
        "REV16 T1": "1011101001 ml dl",
        "REVSH T1": "1011101011 ml dl",
        "NOP T1": "1011111100000000",
        "SEV T1": "1011111101000000",
    }
    names = ("AND", "EOR", "LSL", "LSR", "ASR", "ADC", "SBC", "ROR", "TST", "RSB", "CMP", "CMN",
             "ORR", "MUL", "BIC", "MVN")  # fmt: skip
    for number, name in enumerate(names):
        first = "nl" if name in ("TST", "CMP", "CMN") else "dl"
        rows[f"{name} reg T1"] = f"010000 {number:04b} ml {first}"
    return [Encoding(name, template) for name, template in rows.items()]


def _high_compare(fields: Fields) -> bool:
    return fields["n"] > 7 or fields["m"] > 7


def _modified_constants() -> list[Encoding]:
    """With ThumbExpandImm constants; a byte that is repeated may not be 0 (A5.3.2)."""

    def valid(fields: Fields) -> bool:
        kind = fields["i"] << 3 | fields["imm3"]
        return kind not in (1, 2, 3) or fields["imm8"] != 0

    rows = {}
    numbers = {"AND": 0, "BIC": 1, "ORR": 2, "ORN": 3, "EOR": 4, "ADD": 8, "ADC": 10, "SBC": 11,
               "SUB": 13, "RSB": 14}  # fmt: skip
    for name, number in numbers.items():
        rows[f"{name} imm T"] = f"11110 i:1 0 {number:04b} S:1 n 0 imm3:3 d imm8:8"
        rows[f"{name} reg T"] = f"1110101 {number:04b} S:1 n 0 j:3 d k:2 type:2 m"
    for name, number in {"MOV": 2, "MVN": 3}.items():
        rows[f"{name} imm T"] = f"11110 i:1 0 {number:04b} S:1 1111 0 imm3:3 d imm8:8"
        rows[f"{name} reg T (shifted)"] = f"1110101 {number:04b} S:1 1111 0 j:3 d k:2 type:2 m"
    for name, number in {"TST": 0, "TEQ": 4, "CMN": 8, "CMP": 13}.items():
        rows[f"{name} imm T"] = f"11110 i:1 0 {number:04b} 1 n 0 imm3:3 1111 imm8:8"
        rows[f"{name} reg T"] = f"1110101 {number:04b} 1 n 0 j:3 1111 k:2 type:2 m"
    return [Encoding(name, text, valid if " imm " in name else None) for name, text in rows.items()]


def _plain_constants() -> list[Encoding]:
    def lsb(fields: Fields) -> int:
        return fields["imm3"] << 2 | fields["imm2"]

    def field_fits(fields: Fields) -> bool:
        return lsb(fields) + fields["w"] < 32

    def inserted(fields: Fields) -> bool:
        return fields["msb"] >= lsb(fields)

    def shifts(fields: Fields) -> bool:
        return not fields["sh"] or lsb(fields) != 0

    low = "imm3:3 d imm2:2"
    return [
        Encoding("ADDW T4", "11110 i:1 100000 n 0 imm3:3 d imm8:8"),
        Encoding("SUBW T4", "11110 i:1 101010 n 0 imm3:3 d imm8:8"),
        Encoding("ADR T3", "11110 i:1 10000 0 1111 0 imm3:3 d imm8:8"),
        Encoding("ADR T2", "11110 i:1 10101 0 1111 0 imm3:3 d imm8:8"),
        Encoding("MOVW T3", "11110 i:1 100100 imm4:4 0 imm3:3 d imm8:8"),
        Encoding("MOVT T1", "11110 i:1 101100 imm4:4 0 imm3:3 d imm8:8"),
        Encoding("SSAT T1", f"11110 0 1100 sh:1 0 n 0 {low} 0 w:5", shifts),
        Encoding("USAT T1", f"11110 0 1110 sh:1 0 n 0 {low} 0 w:5", shifts),
        Encoding("SBFX T1", f"11110 0 110100 n 0 {low} 0 w:5", field_fits),
        Encoding("UBFX T1", f"11110 0 111100 n 0 {low} 0 w:5", field_fits),
        Encoding("BFI T1", f"11110 0 110110 n 0 {low} 0 msb:5", inserted),
        Encoding("BFC T1", f"11110 0 110110 1111 0 {low} 0 msb:5", inserted),
    ]


def _two_results(fields: Fields) -> bool:
    return fields["d"] != fields["e"]


def _registers_32() -> list[Encoding]:
    rows = {}
    for number, name in enumerate(["LSL", "LSR", "ASR", "ROR"]):
        rows[f"{name} reg T2"] = f"11111010 0 {number:02b} S:1 n 1111 d 0000 m"
    for number, name in {0: "SXTH", 1: "UXTH", 4: "SXTB", 5: "UXTB"}.items():
        rows[f"{name} T2"] = f"11111010 0 {number:03b} 1111 1111 d 10 rotate:2 m"
    for number, name in enumerate(["REV", "REV16", "RBIT", "REVSH"]):
        rows[f"{name} T2"] = f"11111010 1001 m 1111 d 10 {number:02b} m"
    rows["CLZ T1"] = "11111010 1011 m 1111 d 1000 m"
    rows["MUL T2"] = "111110110000 n 1111 d 0000 m"
    rows["MLA T1"] = "111110110000 n a d 0000 m"
    rows["MLS T1"] = "111110110000 n a d 0001 m"
    rows["SDIV T1"] = "111110111001 n 1111 d 1111 m"
    rows["UDIV T1"] = "111110111011 n 1111 d 1111 m"
    found = [Encoding(name, template) for name, template in rows.items()]
    for name, bits in {"SMULL": "1000", "UMULL": "1010", "SMLAL": "1100", "UMLAL": "1110"}.items():
        found.append(Encoding(f"{name} T1", f"11111011{bits} n e d 0000 m", _two_results))
    return found


def _single_accesses() -> list[Encoding]:
    found = []
    for bits, name in {"0110 0": "STR", "0110 1": "LDR", "0111 0": "STRB", "0111 1": "LDRB",
                       "1000 0": "STRH", "1000 1": "LDRH"}.items():  # fmt: skip
        data = "dl" if name.startswith("LDR") else "ml"
        found.append(Encoding(f"{name} imm T1", f"{bits} i:5 pl {data}"))
    names = ["STR", "STRH", "STRB", "LDRSB", "LDR", "LDRH", "LDRB", "LDRSH"]
    for number, name in enumerate(names):
        data = "dl" if name.startswith("LDR") else "ml"
        found.append(Encoding(f"{name} reg T1", f"0101 {number:03b} xl pl {data}"))
    found += [
        Encoding("STR SP T2", "10010 ml i:8"),
        Encoding("LDR SP T2", "10011 dl i:8"),
        Encoding("LDR literal T1", "01001 dl i:8"),
    ]
    wide = {"STRB": "00 000", "LDRB": "00 001", "STRH": "00 010", "LDRH": "00 011",
            "STR": "00 100", "LDR": "00 101", "LDRSB": "10 001", "LDRSH": "10 011"}  # fmt: skip
    for name, bits in wide.items():
        sign, rest = bits.split()
        load = name.startswith("LDR")
        data = "d" if load else "m"
        head = f"111110 0 {sign[0]}"

        def other(fields: Fields, data: str = data) -> bool:
            return fields[data] != fields["p"]

        found += [
            Encoding(f"{name} imm T3", f"{head} 1 {rest} p {data} i:12"),
            Encoding(f"{name} reg T2", f"{head} 0 {rest} p {data} 000000 shift:2 x"),
            Encoding(f"{name} imm T4 (negative)", f"{head} 0 {rest} p {data} 1100 i:8"),
            Encoding(f"{name} imm T4 (before)", f"{head} 0 {rest} p {data} 11 U:1 1 i:8",
                     other, moves=255),
            Encoding(f"{name} imm T4 (after)", f"{head} 0 {rest} p {data} 10 U:1 1 i:8",
                     other, moves=255),
            Encoding(f"{name}T", f"{head} 0 {rest} p {data} 1110 i:8"),
        ]  # fmt: skip
        if load:
            found.append(Encoding(f"{name} literal T2", f"{head} U:1 {rest} 1111 d i:12"))
    for name, bits in {"PLD imm": "00", "PLI imm": "10"}.items():
        found.append(Encoding(name, f"111110 0 {bits[0]} 1001 p 1111 i:12"))
    return found


def _several_accesses() -> list[Encoding]:
    def distinct(fields: Fields) -> bool:
        return len({fields["d"], fields["e"], fields["p"]}) == 3

    def stored(fields: Fields) -> bool:
        return fields["p"] not in (fields["m"], fields["n"])

    return [
        Encoding("LDRD (offset)", "1110100 1 U:1 1 0 1 q d e i:8", distinct),
        Encoding("LDRD (before)", "1110100 1 U:1 1 1 1 q d e i:8", distinct, 1020),
        Encoding("LDRD (after)", "1110100 0 U:1 1 1 1 q d e i:8", distinct, 1020),
        Encoding("LDRD literal", "1110100 1 U:1 1 0 1 1111 d e i:8", _two_results),
        Encoding("STRD (offset)", "1110100 1 U:1 1 0 0 q m n i:8"),
        Encoding("STRD (before)", "1110100 1 U:1 1 1 0 q m n i:8", stored, 1020),
        Encoding("STRD (after)", "1110100 0 U:1 1 1 0 q m n i:8", stored, 1020),
    ]  # fmt: skip


def _system() -> list[Encoding]:
    found = [Encoding("MSR APSR", "11110011100 0 n 1000 10 00 00000000")]
    # Without BASEPRI, whose bits depend on the part: test_core.py.
    for number in (0, 1, 2, 3, 5, 6, 7, 8, 9, 16, 19, 20):
        found.append(Encoding(f"MRS {number}", f"11110011111 01111 1000 d {number:08b}"))
    found += [
        Encoding("MSR PRIMASK", "11110011100 0 n 1000 1000 00010000"),
        Encoding("MSR FAULTMASK", "11110011100 0 n 1000 1000 00010011"),
        Encoding("CPS", "10110110011 im:1 00 IF:2", lambda f: f["IF"] != 0, in_it=False),
        Encoding("CLREX", "1111001110111111 1000111100101111"),
        Encoding("DSB", "1111001110111111 100011110100 o:4"),
        Encoding("DMB", "1111001110111111 100011110101 o:4"),
        # After an ISB unicorn runs the rest of an IT block unconditionally.
        Encoding("ISB", "1111001110111111 100011110110 o:4", in_it=False),
        Encoding("NOP T2", "1111001110101111 1000000000000000"),
        Encoding("SEV T2", "1111001110101111 1000000000000100"),
    ]
    return found


ENCODINGS: tuple[Encoding, ...] = (
    *_shift_add_16(),
    Encoding("CMP reg T2", "01000101 nH m nL", _high_compare),
    *_modified_constants(),
    *_plain_constants(),
    *_registers_32(),
    *_single_accesses(),
    *_several_accesses(),
    *_system(),
)
"""Instructions without conditions on others. programs.py adds branches, IT blocks, multiple
transfers, exclusive accesses and changes of SP."""
