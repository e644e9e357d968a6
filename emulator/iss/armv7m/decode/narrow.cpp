// 16-bit instructions (ARMv7-M ARM A5.2).

#include "armv7m/decode/decode.h"

namespace armv7m {

namespace narrow {

Operation make(uint32_t code, uint32_t d = 0, uint32_t n = 0, uint32_t m = 0, uint32_t value = 0) {
    Operation op = {};
    op.code = op.in_it = (uint8_t)code;
    op.d = (uint8_t)d, op.n = (uint8_t)n, op.m = (uint8_t)m;
    op.value = value;
    op.halves = 1;
    return op;
}

// Sets flags only outside an IT block.
Operation flagged(uint32_t outside, uint32_t inside, uint32_t d, uint32_t n, uint32_t m = 0,
                  uint32_t value = 0) {
    Operation op = make(outside, d, n, m, value);
    op.in_it = (uint8_t)inside;
    return op;
}

Operation undefined() { return make(C_UNDEFINED); }

// Not allowed within an IT block (A7.3: UNPREDICTABLE there).
Operation outside_it(Operation op) {
    op.in_it = C_UNDEFINED;
    return op;
}

Operation shift_add_move_compare(uint32_t half) {
    const uint32_t d = half & 7, n = half >> 3 & 7, m = half >> 6 & 7;
    const uint32_t constant = half & 0xFF, r = half >> 8 & 7, amount = half >> 6 & 31;
    const auto shift = [&](uint32_t outside, uint32_t inside) {
        Operation op = flagged(outside, inside, d, 0, n);
        op.shift = (uint8_t)(amount ? amount : 32);
        return op;
    };
    switch (half >> 11) {
    case 0:
        return amount ? shift(C_LSLS_I, C_LSL_I) : flagged(C_MOVS_R, C_MOV_R, d, 0, n);
    case 1: return shift(C_LSRS_I, C_LSR_I);
    case 2: return shift(C_ASRS_I, C_ASR_I);
    case 3:
        switch (half >> 9 & 3) {
        case 0: return flagged(C_ADDS_R, C_ADD_R, d, n, m);
        case 1: return flagged(C_SUBS_R, C_SUB_R, d, n, m);
        case 2: return flagged(C_ADDS_I, C_ADD_I, d, n, 0, m);
        default: return flagged(C_SUBS_I, C_SUB_I, d, n, 0, m);
        }
    case 4: return flagged(C_MOVS_I, C_MOV_I, r, 0, 0, constant);
    case 5: return make(C_CMP_I, 0, r, 0, constant);
    case 6: return flagged(C_ADDS_I, C_ADD_I, r, r, 0, constant);
    default: return flagged(C_SUBS_I, C_SUB_I, r, r, 0, constant);
    }
}

Operation data_processing(uint32_t half) {
    const uint32_t d = half & 7, m = half >> 3 & 7;
    const auto shift = [&](uint32_t outside, uint32_t inside) {
        Operation op = flagged(outside, inside, d, 0, d);
        op.a = (uint8_t)m;
        return op;
    };
    switch (half >> 6 & 15) {
    case 0: return flagged(C_ANDS_R, C_AND_R, d, d, m);
    case 1: return flagged(C_EORS_R, C_EOR_R, d, d, m);
    case 2: return shift(C_LSLS_V, C_LSL_V);
    case 3: return shift(C_LSRS_V, C_LSR_V);
    case 4: return shift(C_ASRS_V, C_ASR_V);
    case 5: return flagged(C_ADCS_R, C_ADC_R, d, d, m);
    case 6: return flagged(C_SBCS_R, C_SBC_R, d, d, m);
    case 7: return shift(C_RORS_V, C_ROR_V);
    case 8: return make(C_TST_R, 0, d, m);
    case 9: return flagged(C_RSBS_I, C_RSB_I, d, m);
    case 10: return make(C_CMP_R, 0, d, m);
    case 11: return make(C_CMN_R, 0, d, m);
    case 12: return flagged(C_ORRS_R, C_ORR_R, d, d, m);
    case 13: return flagged(C_MULS, C_MUL, d, m, d);
    case 14: return flagged(C_BICS_R, C_BIC_R, d, d, m);
    default: return flagged(C_MVNS_R, C_MVN_R, d, 0, m);
    }
}

Operation high_registers(uint32_t half) {
    const uint32_t d = (half & 7) | (half >> 4 & 8), m = half >> 3 & 15;
    switch (half >> 8 & 3) {
    case 0:
        if (d == 15 && m == 15) return undefined();
        if (d >= 13 || m == 15) return make(C_ADD_HIGH, d, d, m);
        return make(C_ADD_R, d, d, m);
    case 1:    // two low registers are UNPREDICTABLE; it compares
        return d == 15 || m == 15 ? undefined() : make(C_CMP_R, 0, d, m);
    case 2:
        if (d >= 13 || m == 15) return make(C_MOV_HIGH, d, 0, m);
        return make(C_MOV_R, d, 0, m);
    default:    // the low bits should be 0; they are ignored
        if (half & 0x80) return m == 15 ? undefined() : make(C_BLX, 0, 0, m);
        return make(C_BX, 0, 0, m);
    }
}

Operation load_store(uint32_t half) {
    static const uint16_t by_register[8] = {C_STR_M, C_STRH_M, C_STRB_M, C_LDRSB_M,
                                            C_LDR_M, C_LDRH_M, C_LDRB_M, C_LDRSH_M};
    const uint32_t d = half & 7, n = half >> 3 & 7, m = half >> 6 & 7, offset = half >> 6 & 31;
    const uint32_t r = half >> 8 & 7, words = (half & 0xFF) << 2;
    switch (half >> 11) {
    case 10: case 11: return make(by_register[half >> 9 & 7], d, n, m);
    case 12: return make(C_STR_O, d, n, 0, offset << 2);
    case 13: return make(C_LDR_O, d, n, 0, offset << 2);
    case 14: return make(C_STRB_O, d, n, 0, offset);
    case 15: return make(C_LDRB_O, d, n, 0, offset);
    case 16: return make(C_STRH_O, d, n, 0, offset << 1);
    case 17: return make(C_LDRH_O, d, n, 0, offset << 1);
    case 18: return make(C_STR_O, r, 13, 0, words);
    default: return make(C_LDR_O, r, 13, 0, words);
    }
}

Operation if_then(uint32_t half) {
    const uint32_t condition = half >> 4 & 15, mask = half & 15;
    if (mask == 0) {
        static const uint16_t hints[5] = {C_NOP, C_NOP, C_WFE, C_WFI, C_SEV};
        return make(condition < 5 ? hints[condition] : (uint16_t)C_NOP);    // NOP, YIELD, ...
    }
    // AL with an else branch, and condition 15, are UNPREDICTABLE.
    if (condition == 15 || (condition == 14 && (mask & (mask - 1)) != 0)) return undefined();
    return outside_it(make(C_IT, 0, 0, 0, half & 0xFF));
}

Operation miscellaneous(uint32_t half) {
    const uint32_t d = half & 7, m = half >> 3 & 7;
    const uint32_t distance = (half >> 3 & 0x40) | (half >> 2 & 0x3E);
    Operation op = {};
    switch (half >> 8 & 15) {
    case 0:
        op = make(C_ADD_SP_I, 13, 13, 0, (half & 0x7F) << 2);
        if (half & 0x80) op.value = 0u - op.value;
        return op;
    case 1: case 3: return outside_it(make(C_CBZ, 0, d, 0, distance + 4));
    case 9: case 11: return outside_it(make(C_CBNZ, 0, d, 0, distance + 4));
    case 2: {
        static const uint16_t extend[4] = {C_SXTH, C_SXTB, C_UXTH, C_UXTB};
        return make(extend[half >> 6 & 3], d, 0, m);
    }
    case 4: case 5: case 12: case 13: {
        const bool pop = half & 0x800;
        op = make(pop ? C_LDM : C_STM, 0, 13, 1);
        op.list = (uint16_t)((half & 0xFF) | (half & 0x100) << (pop ? 7 : 6));
        op.a = !pop;
        op.value = 4 * (uint32_t)__builtin_popcount(op.list);
        return op.list ? op : undefined();
    }
    case 6:    // CPS: bit 0 of `value` FAULTMASK, bit 1 PRIMASK, bit 4 disable
        return (half & 0xE0) == 0x60 ? outside_it(make(C_CPS, 0, 0, 0, half & 0x13)) : undefined();
    case 10: {
        static const uint16_t reverse[4] = {C_REV, C_REV16, C_UNDEFINED, C_REVSH};
        return make(reverse[half >> 6 & 3], d, 0, m);
    }
    case 14: return make(C_BKPT, 0, 0, 0, half & 0xFF);
    case 15: return if_then(half);
    default: return undefined();
    }
}

Operation multiple(uint32_t half) {
    const bool load = half & 0x800;
    const uint32_t n = half >> 8 & 7;
    Operation op = make(load ? C_LDM : C_STM, 0, n, 1);
    op.list = (uint16_t)(half & 0xFF);
    op.value = 4 * (uint32_t)__builtin_popcount(op.list);
    if (load && (op.list >> n & 1)) op.m = 0;
    return op.list ? op : undefined();
}

}  // namespace narrow

Operation decode_16(uint32_t half) {
    using namespace narrow;
    const uint32_t r = half >> 8 & 7;
    if (half >> 14 == 0) return shift_add_move_compare(half);
    switch (half >> 10) {
    case 16: return data_processing(half);
    case 17: return high_registers(half);
    case 18: case 19: return make(C_LDR_L, r, 15, 0, (half & 0xFF) << 2);
    case 40: case 41: return make(C_ADR, r, 15, 0, (half & 0xFF) << 2);
    case 42: case 43: return make(C_ADD_I, r, 13, 0, (half & 0xFF) << 2);
    case 44: case 45: case 46: case 47: return miscellaneous(half);
    case 48: case 49: case 50: case 51: return multiple(half);
    case 52: case 53: case 54: case 55: {
        const uint32_t condition = half >> 8 & 15;
        if (condition == 14) return make(C_UNDEFINED);
        if (condition == 15) return make(C_SVC, 0, 0, 0, half & 0xFF);
        return outside_it(make(C_B_EQ + condition, 0, 0, 0, (uint32_t)(int8_t)half * 2 + 4));
    }
    case 56: case 57:
        return make(C_B, 0, 0, 0, (uint32_t)((int32_t)(half << 21) >> 20) + 4);
    default: return load_store(half);
    }
}

}  // namespace armv7m
