// 32-bit instructions except loads and stores (ARMv7-M ARM A5.3).

#include "armv7m/decode/decode.h"

namespace armv7m {

namespace broad {

constexpr uint32_t SET_FLAGS = 3;    // from op_I to opS_I, in the order of codes.h

// SP and PC, which are UNPREDICTABLE in most places.
bool bad(uint32_t r) { return r == 13 || r == 15; }

// ThumbExpandImm_C (A5.3.2); `rotated`: the carry becomes bit 31.
uint32_t expand(uint32_t field, bool &rotated) {
    const uint32_t byte = field & 0xFF;
    rotated = false;
    switch (field >> 8) {
    case 0: return byte;
    case 1: return byte << 16 | byte;
    case 2: return byte << 24 | byte << 8;
    case 3: return byte * 0x01010101u;
    default: break;
    }
    const uint32_t rotation = field >> 7, value = 0x80 | (field & 0x7F);
    rotated = true;
    return value >> rotation | value << (32 - rotation);
}

// The twelve bits i:imm3:imm8.
uint32_t field_12(uint32_t first, uint32_t second) {
    return (first << 1 & 0x800) | (second >> 4 & 0x700) | (second & 0xFF);
}

// Sets the code of a data-processing instruction; `form`: 0 constant, 1 register, 2 shifted
// register. False: not an instruction.
bool choose(Operation &op, uint32_t number, bool flags, uint32_t form) {
    static const uint16_t codes[16] = {
        C_AND_I, C_BIC_I, C_ORR_I, C_ORN_I, C_EOR_I, 0, 0, 0, C_ADD_I, 0, C_ADC_I, C_SBC_I, 0,
        C_SUB_I, C_RSB_I, 0};
    uint32_t code = codes[number];
    if (code == 0 || (form != 0 && bad(op.m))) return false;
    const bool result = op.d != 15;
    if (number == 2 && op.n == 15) code = C_MOV_I;
    else if (number == 3 && op.n == 15) code = C_MVN_I;
    else if (!result) {    // comparisons: the same numbers with flags and without a result
        if (!flags || op.n == 15 || (number <= 4 && op.n == 13)) return false;
        switch (number) {
        case 0: code = C_TST_I; break;
        case 4: code = C_TEQ_I; break;
        case 8: code = C_CMN_I; break;
        case 13: code = C_CMP_I; break;
        default: return false;
        }
        op.code = (uint16_t)(code + form);
        return true;
    } else if ((number == 8 || number == 13) && op.n == 13) {
        // ADD and SUB accept SP, also as the result (a shift of more than 3 is then UNPREDICTABLE,
        // and performed).
        if (op.d == 13) {
            if (form == 0) {
                op.code = C_ADD_SP_I, op.a = flags, op.m = number == 13;
                return true;
            }
            op.code = number == 8 ? C_ADD_SP_X : C_SUB_SP_X;
            op.list = flags;
            return true;
        }
    } else if (bad(op.n)) {
        return false;
    }
    if (bad(op.d)) return false;
    op.code = (uint16_t)(code + form + (flags ? SET_FLAGS : 0));
    return true;
}

Operation modified_constant(uint32_t first, uint32_t second) {
    Operation op = wide(C_UNDEFINED, second >> 8 & 15, first & 15);
    bool rotated;
    op.value = expand(field_12(first, second), rotated);
    op.shift = rotated;
    return choose(op, first >> 5 & 15, first & 0x10, 0) ? op : undefined_32();
}

Operation shifted_register(uint32_t first, uint32_t second) {
    Operation op = wide(C_UNDEFINED, second >> 8 & 15, first & 15, second & 15);
    const uint32_t type = second >> 4 & 3, number = first >> 5 & 15;
    const bool flags = first & 0x10;
    uint32_t amount = (second >> 10 & 0x1C) | (second >> 6 & 3);
    const bool plain = type == 0 && amount == 0;
    if (amount == 0 && (type == 1 || type == 2)) amount = 32;
    op.a = (uint8_t)type, op.shift = (uint8_t)amount;
    if (number == 2 && op.n == 15 && (plain || amount != 0)) {    // MOV, LSL, LSR, ASR, ROR
        static const uint16_t shifts[4] = {C_LSL_I, C_LSR_I, C_ASR_I, C_ROR_I};
        if (plain && !flags && (op.d == 13 || op.m == 13) && op.d != 15 && op.m != 15) {
            op.code = C_MOV_HIGH;
            return op;
        }
        if (bad(op.d) || bad(op.m)) return undefined_32();
        op.code = (uint16_t)(plain ? C_MOV_R + (flags ? SET_FLAGS : 0) : shifts[type] + flags);
        return op;
    }
    // Amount 0 of type 3 is RRX: form 2 with that type and amount.
    return choose(op, number, flags, plain ? 1 : 2) ? op : undefined_32();
}

Operation plain_constant(uint32_t first, uint32_t second) {
    const uint32_t d = second >> 8 & 15, n = first & 15, field = field_12(first, second);
    const uint32_t low = (second >> 10 & 0x1C) | (second >> 6 & 3);
    Operation op = wide(C_UNDEFINED, d, n);
    switch (first >> 4 & 31) {
    case 0: case 10: {    // ADDW, SUBW, ADR
        const bool subtract = first & 0x80;
        op.value = field;
        if (n == 15) {
            op.code = C_ADR;
            op.value = subtract ? 0u - field : field;
        } else if (n == 13 && d == 13) {
            op.code = C_ADD_SP_I, op.m = subtract;
            return op;
        } else {
            op.code = subtract ? C_SUB_I : C_ADD_I;
        }
        return bad(d) ? undefined_32() : op;
    }
    case 4: case 12:    // MOVW, MOVT
        op.code = first & 0x80 ? C_MOVT : C_MOV_I;
        op.value = n << 12 | field;
        return bad(d) ? undefined_32() : op;
    case 16: case 18: case 24: case 26:    // SSAT, USAT; a: ASR
        if ((first & 0x20) && low == 0) return undefined_32();    // SSAT16, USAT16: DSP extension
        op.code = first & 0x80 ? C_USAT : C_SSAT;
        op.value = (second & 31) + (first & 0x80 ? 0 : 1);
        op.a = first >> 5 & 1;
        op.shift = (uint8_t)low;
        break;
    case 20: case 28:    // SBFX, UBFX: shift the field up by `value`, then down by `list`
        if (low + (second & 31) > 31) return undefined_32();
        op.code = first & 0x80 ? C_UBFX : C_SBFX;
        op.value = 31 - low - (second & 31);
        op.list = (uint16_t)(31 - (second & 31));
        break;
    case 22: {    // BFI, BFC (n = 15): `value` is the mask
        if ((second & 31) < low) return undefined_32();
        op.code = C_BFI;
        op.value = (0xFFFFFFFFu >> (31 - ((second & 31) - low))) << low;
        op.shift = (uint8_t)low;
        op.a = n == 15;
        return bad(d) || n == 13 ? undefined_32() : op;
    }
    default: return undefined_32();
    }
    return bad(d) || bad(n) ? undefined_32() : op;
}

Operation branch_or_control(uint32_t first, uint32_t second) {
    const uint32_t s = first >> 10 & 1, j1 = second >> 13 & 1, j2 = second >> 11 & 1;
    const uint32_t high = first & 0x3FF, low = second & 0x7FF, condition = first >> 6 & 15;
    if (second & 0x1000) {    // B.W and BL
        const uint32_t i1 = !(j1 ^ s), i2 = !(j2 ^ s);
        const uint32_t offset = s << 24 | i1 << 23 | i2 << 22 | high << 12 | low << 1;
        const uint32_t distance = (uint32_t)((int32_t)(offset << 7) >> 7) + 4;
        return wide(second & 0x4000 ? C_BL : C_B, 0, 0, 0, distance);
    }
    if (second & 0x4000) {    // BLX to ARM code, and UDF.W
        return undefined_32();
    }
    if (condition < 14) {
        const uint32_t offset =
            s << 20 | j2 << 19 | j1 << 18 | (first & 0x3F) << 12 | low << 1;
        return wide(C_B_EQ + condition, 0, 0, 0, (uint32_t)((int32_t)(offset << 11) >> 11) + 4);
    }
    switch (first >> 4 & 0x7F) {
    case 0x38: case 0x39: {    // MSR; mask 0 is UNPREDICTABLE and writes nothing
        Operation op = wide(C_MSR, 0, first & 15, 0, second & 0xFF);
        op.a = second >> 10 & 3;
        return bad(op.n) ? undefined_32() : op;
    }
    case 0x3A:    // hints; those without a meaning are NOPs
        if (second & 0x700) return undefined_32();
        switch (second & 0xFF) {
        case 2: return wide(C_WFE);
        case 3: return wide(C_WFI);
        case 4: return wide(C_SEV);
        default: return wide(C_NOP);
        }
    case 0x3B:
        switch (second >> 4 & 15) {
        case 2: return wide(C_CLREX);
        case 4: case 5: return wide(C_BARRIER);
        case 6: return wide(C_ISB);
        default: return undefined_32();
        }
    case 0x3E: case 0x3F: {
        const Operation op = wide(C_MRS, second >> 8 & 15, 0, 0, second & 0xFF);
        return bad(op.d) ? undefined_32() : op;
    }
    default: return undefined_32();
    }
}

Operation register_processing(uint32_t first, uint32_t second) {
    const uint32_t d = second >> 8 & 15, n = first & 15, m = second & 15;
    if ((second & 0xF000) != 0xF000 || bad(d) || bad(m)) return undefined_32();
    const uint32_t number = first >> 4 & 15;
    if (!(second & 0x80)) {
        if (number < 8 && !(second & 0x70)) {    // shifts by a register
            static const uint16_t shifts[8] = {C_LSL_V, C_LSLS_V, C_LSR_V, C_LSRS_V,
                                               C_ASR_V, C_ASRS_V, C_ROR_V, C_RORS_V};
            if (bad(n)) return undefined_32();
            Operation op = wide(shifts[number], d, 0, n);
            op.a = (uint8_t)m;
            return op;
        }
        return undefined_32();    // parallel additions: DSP extension
    }
    if (number < 6 && n == 15 && !(second & 0x40)) {    // with an addend: DSP extension
        static const uint16_t extend[6] = {C_SXTH, C_UXTH, 0, 0, C_SXTB, C_UXTB};
        if (extend[number] == 0) return undefined_32();
        Operation op = wide(extend[number], d, 0, m);
        op.shift = second >> 1 & 0x18;
        return op;
    }
    if (n != m) return undefined_32();    // UNPREDICTABLE
    if (number == 9) {
        static const uint16_t reverse[4] = {C_REV, C_REV16, C_RBIT, C_REVSH};
        return second & 0x40 ? undefined_32() : wide(reverse[second >> 4 & 3], d, 0, m);
    }
    return number == 11 && !(second & 0x70) ? wide(C_CLZ, d, 0, m) : undefined_32();
}

Operation multiply(uint32_t first, uint32_t second) {
    const uint32_t d = second >> 8 & 15, n = first & 15, m = second & 15, a = second >> 12;
    if ((first & 0x70) || (second & 0xE0) || bad(d) || bad(n) || bad(m)) return undefined_32();
    const bool subtract = second & 0x10;
    Operation op = wide(subtract ? C_MLS : a == 15 ? C_MUL : C_MLA, d, n, m);
    op.a = (uint8_t)a;
    return a == 13 || (subtract && a == 15) ? undefined_32() : op;
}

Operation long_multiply(uint32_t first, uint32_t second) {
    const uint32_t d = second >> 8 & 15, n = first & 15, m = second & 15, low = second >> 12;
    const uint32_t kind = (first & 0x70) | (second >> 4 & 15);
    if (bad(n) || bad(m) || bad(d)) return undefined_32();
    uint32_t code;
    switch (kind) {
    case 0x00: code = C_SMULL; break;
    case 0x1F: code = C_SDIV; break;
    case 0x20: code = C_UMULL; break;
    case 0x3F: code = C_UDIV; break;
    case 0x40: code = C_SMLAL; break;
    case 0x60: code = C_UMLAL; break;
    default: return undefined_32();
    }
    const bool divide = code == C_SDIV || code == C_UDIV;    // their field should be 15: ignored
    if (!divide && (bad(low) || low == d)) return undefined_32();
    Operation op = wide(code, d, n, m);
    op.a = (uint8_t)low;
    return op;
}

Operation decode(uint32_t first, uint32_t second) {
    const uint32_t op2 = first >> 4 & 0x7F;
    if (op2 & 0x40 && (first & 0x1800) != 0x1000) return wide(C_COPROCESSOR);
    switch (first >> 11 & 3) {
    case 1:
        return op2 & 0x20 ? shifted_register(first, second)
               : op2 & 4  ? dual_or_exclusive(first, second)
                          : load_store_multiple(first, second);
    case 2:
        return second & 0x8000 ? branch_or_control(first, second)
               : op2 & 0x20    ? plain_constant(first, second)
                               : modified_constant(first, second);
    default:
        switch (op2 >> 3) {
        case 4: case 5: return register_processing(first, second);
        case 6: return multiply(first, second);
        case 7: return long_multiply(first, second);
        default: return load_store_single(first, second);
        }
    }
}

}  // namespace broad

Operation decode_32(uint32_t first, uint32_t second) {
    Operation op = broad::decode(first, second);
    op.in_it = op.code >= C_B_EQ && op.code <= C_B_LE ? (uint8_t)C_UNDEFINED : (uint8_t)op.code;
    return op;
}

}  // namespace armv7m
