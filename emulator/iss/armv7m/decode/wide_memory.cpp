// 32-bit loads and stores (ARMv7-M ARM A5.3.5 to A5.3.10).

#include "armv7m/decode/decode.h"

namespace armv7m {

namespace broad_memory {

// Distance from LDR_O to its other forms, in the order of codes.h.
enum Form { OFFSET, BY_REGISTER, BEFORE, AFTER };

int bits_in(uint32_t list) {
    int count = 0;
    for (; list; list &= list - 1) count++;
    return count;
}

}  // namespace broad_memory

// LDM and STM: m = write back, a = decrement before.
Operation load_store_multiple(uint32_t first, uint32_t second) {
    using broad_memory::bits_in;
    const bool load = first & 0x10, write_back = first & 0x20;
    const uint32_t n = first & 15, direction = first >> 7 & 3;
    if (direction == 0 || direction == 3) return undefined_32();    // of other profiles
    Operation op = wide(load ? C_LDM : C_STM, 0, n, write_back);
    op.list = (uint16_t)second;
    op.value = 4 * (uint32_t)bits_in(second);
    op.a = direction == 2;
    const bool odd = n == 15 || bits_in(second) < 2 || (second & 0x2000) ||
                     (load ? (second & 0xC000) == 0xC000 : (second & 0x8000) != 0) ||
                     (write_back && (second >> n & 1));
    return odd ? undefined_32() : op;
}

Operation dual_or_exclusive(uint32_t first, uint32_t second) {
    const uint32_t n = first & 15, t = second >> 12, t2 = second >> 8 & 15;
    const uint32_t offset = (second & 0xFF) << 2;
    const bool load = first & 0x10, index = first & 0x100, add = first & 0x80;
    const bool write_back = first & 0x20;
    if (index || write_back) {    // LDRD, STRD: a = second register, m: 1 before, 2 after
        Operation op = wide(load ? C_LDRD : C_STRD, t, n, 0, add ? offset : 0u - offset);
        op.a = (uint8_t)t2;
        op.m = !write_back ? 0 : index ? 1 : 2;
        const bool odd = t == 13 || t == 15 || t2 == 13 || t2 == 15 || (load && t == t2) ||
                         (write_back && (n == 15 || n == t || n == t2)) || (!load && n == 15);
        return odd ? undefined_32() : op;
    }
    if (!add) {    // LDREX, STREX of words; shift = bytes
        Operation op = wide(load ? C_LDREX : C_STREX, t, n, t2, offset);
        op.shift = 4;
        const bool odd = t == 13 || t == 15 || n == 15 ||
                         (!load && (t2 == 13 || t2 == 15 || t2 == n || t2 == t));
        return odd ? undefined_32() : op;
    }
    const uint32_t kind = second >> 4 & 15, d = second & 15;
    if (kind < 2) {    // TBB, TBH
        const bool fits = load && d != 13 && d != 15 && n != 13;
        return fits ? wide(kind ? C_TBH : C_TBB, 0, n, d) : undefined_32();
    }
    if (kind == 4 || kind == 5) {
        Operation op = wide(load ? C_LDREX : C_STREX, t, n, d);
        op.shift = kind == 4 ? 1 : 2;
        const bool odd = t == 13 || t == 15 || n == 15 ||
                         (!load && (d == 13 || d == 15 || d == n || d == t));
        return odd ? undefined_32() : op;
    }
    return undefined_32();
}

// All single loads and stores. Loads of words into SP or PC are LDR_WIDE: a = form (4: literal).
Operation load_store_single(uint32_t first, uint32_t second) {
    using namespace broad_memory;
    const bool load = first & 0x10, is_signed = first & 0x100;
    const uint32_t size = first >> 5 & 3, n = first & 15, t = second >> 12;
    if (size == 3 || (is_signed && (!load || size == 2))) return undefined_32();
    static const uint16_t loads[5] = {C_LDRB_O, C_LDRH_O, C_LDR_O, C_LDRSB_O, C_LDRSH_O};
    static const uint16_t literals[5] = {C_LDRB_L, C_LDRH_L, C_LDR_L, C_LDRSB_L, C_LDRSH_L};
    static const uint16_t stores[3] = {C_STRB_O, C_STRH_O, C_STR_O};
    const uint32_t kind = size + (is_signed ? 3 : 0);
    Operation op = wide(load ? loads[kind] : stores[size], t, n);
    uint32_t form = OFFSET;
    bool hint = load && size < 2 && t == 15;    // PLD, PLI

    if (n == 15) {
        if (!load) return undefined_32();
        op.code = op.in_it = literals[kind];
        op.value = first & 0x80 ? second & 0xFFF : 0u - (second & 0xFFF);
        form = 4;
    } else if (first & 0x80) {
        op.value = second & 0xFFF;
    } else if (second & 0x800) {
        const bool index = second & 0x400, add = second & 0x200, write_back = second & 0x100;
        op.value = add ? second & 0xFF : 0u - (second & 0xFF);
        if (!index && !write_back) return undefined_32();
        if (index && add && !write_back) {    // LDRT and the like: a = bytes, m = signed
            op.code = op.in_it = load ? C_LOAD_USER : C_STORE_USER;
            op.a = (uint8_t)(1u << size), op.m = is_signed;
            return t == 13 || t == 15 ? undefined_32() : op;
        }
        form = !index ? AFTER : write_back ? BEFORE : OFFSET;
        if (write_back && n == t) return undefined_32();
        if (form != OFFSET) hint = false;
    } else {
        if (second & 0x7C0) return undefined_32();
        op.m = second & 15;
        op.shift = second >> 4 & 3;
        form = BY_REGISTER;
        if (op.m == 13 || op.m == 15) return undefined_32();
    }
    if (hint) return wide(C_NOP);
    if (t == 15 ? !load || size != 2 : t == 13 && size != 2) return undefined_32();
    if (load && (t == 13 || t == 15)) {
        op.code = op.in_it = C_LDR_WIDE;
        op.a = (uint8_t)form;
    } else if (form != 4) {
        op.code = op.in_it = (uint8_t)(op.code + form);
    }
    return op;
}

// Data processing that writes d, and with a second result a.
static bool computes(const Operation &op, uint32_t number) {
    if (op.code < C_AND_I || op.code > C_UXTH) return false;
    if (op.code >= C_TST_I && op.code <= C_CMP_X) return false;
    return op.d == number || (op.code >= C_UMULL && op.code <= C_SMLAL && op.a == number);
}

static uint32_t half_at(const uint8_t *code, uint32_t offset) {
    return code[offset] | (uint32_t)code[offset + 1] << 8;
}

// Finds where the preceding instruction begins: in a run of half-words that look like the first
// half of a 32-bit instruction, first and second halves alternate.
uint8_t address_stall(const Operation &op, const uint8_t *code, uint32_t offset) {
    if (op.code < C_LDR_O || op.code > C_STREX || offset < 2) return 0;
    if (op.code >= C_LDR_L && op.code <= C_LDRSB_L) return 0;
    uint32_t run = 0;
    while (offset >= 4 + 2 * run && run < 16 && is_wide(half_at(code, offset - 4 - 2 * run))) run++;
    const uint32_t last = half_at(code, offset - 2);
    if (!(run & 1) && is_wide(last)) return 0;    // data: no instruction ends here
    const Operation front = run & 1 ? decode_32(half_at(code, offset - 4), last) : decode_16(last);
    const bool indexed = op.code >= C_LDR_O && op.code <= C_STRB_Q && (op.code - C_LDR_O) % 4 == 1;
    return computes(front, op.n) || (indexed && computes(front, op.m));
}

}  // namespace armv7m
