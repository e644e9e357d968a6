// Data processing (ARMv7-M ARM A4.4). Part of Cpu::loop.

#define RESULT(expression) \
    do { \
        r[op->d] = (expression); \
        NEXT(1); \
    } while (0)
#define RESULT_NZ(expression) \
    do { \
        const uint32_t result = (expression); \
        r[op->d] = result; \
        nz = result; \
        NEXT(1); \
    } while (0)
#define SHIFTED_M(carry_out) shifted(r[op->m], op->a, op->shift, carry_out)

// The three operand forms of an instruction: the statements use operands `a` and `b`.
#define FORM(name, operand, ...) \
    HANDLE(name) { \
        [[maybe_unused]] const uint32_t a = r[op->n]; \
        const uint32_t b = (operand); \
        __VA_ARGS__; \
    }
#define FORMS(name, ...) \
    FORM(name##_I, op->value, __VA_ARGS__) \
    FORM(name##_R, r[op->m], __VA_ARGS__) \
    HANDLE(name##_X) { \
        uint8_t unused = carry; \
        [[maybe_unused]] const uint32_t a = r[op->n]; \
        const uint32_t b = SHIFTED_M(unused); \
        __VA_ARGS__; \
    }
// Likewise, where the operand sets the carry.
#define FORMS_WITH_CARRY(name, ...) \
    FORM(name##_I, constant_with_carry(*op, carry), __VA_ARGS__) \
    FORM(name##_R, r[op->m], __VA_ARGS__) \
    FORM(name##_X, SHIFTED_M(carry), __VA_ARGS__)

#define LOGIC(name, expression) \
    FORMS(name, RESULT(expression)) \
    FORMS_WITH_CARRY(name##S, RESULT_NZ(expression))

LOGIC(AND, a & b)
LOGIC(BIC, a & ~b)
LOGIC(ORR, a | b)
LOGIC(ORN, a | ~b)
LOGIC(EOR, a ^ b)
LOGIC(MOV, b)
LOGIC(MVN, ~b)

#define TEST(name, expression) \
    FORMS_WITH_CARRY(name, { \
        nz = (uint32_t)(expression); \
        NEXT(1); \
    })

TEST(TST, a & b)
TEST(TEQ, a ^ b)

// AddWithCarry (A2.2.1) of x, y and a carry.
#define SUM_FLAGS(x, y, carry_in) \
    const uint32_t first = (x), second = (y); \
    const uint64_t sum = (uint64_t)first + second + (carry_in); \
    const uint32_t total = (uint32_t)sum; \
    carry = (uint8_t)(sum >> 32); \
    overflow = (uint8_t)(((first ^ total) & (second ^ total)) >> 31); \
    nz = total
// Likewise without a carry: the host has the flags.
#define PLAIN_SUM_FLAGS(x, y) \
    const uint32_t first = (x), second = (y), total = first + second; \
    int32_t wrapped; \
    carry = total < first; \
    overflow = __builtin_add_overflow((int32_t)first, (int32_t)second, &wrapped); \
    nz = total
// The same for x - y, that is x, ~y and 1.
#define DIFFERENCE_FLAGS(x, y) \
    const uint32_t first = (x), second = (y), total = first - second; \
    int32_t wrapped; \
    carry = first >= second; \
    overflow = __builtin_sub_overflow((int32_t)first, (int32_t)second, &wrapped); \
    nz = total
#define COMPARE(name, flags) \
    FORMS(name, { \
        flags; \
        NEXT(1); \
    })
#define ARITHMETIC(name, result, flags) \
    FORMS(name, RESULT(result)) \
    FORMS(name##S, { \
        flags; \
        r[op->d] = total; \
        NEXT(1); \
    })

ARITHMETIC(ADD, a + b, PLAIN_SUM_FLAGS(a, b))
ARITHMETIC(ADC, a + b + carry, SUM_FLAGS(a, b, (uint32_t)carry))
ARITHMETIC(SUB, a - b, DIFFERENCE_FLAGS(a, b))
ARITHMETIC(SBC, a + ~b + carry, SUM_FLAGS(a, ~b, (uint32_t)carry))
ARITHMETIC(RSB, b - a, DIFFERENCE_FLAGS(b, a))
COMPARE(CMN, PLAIN_SUM_FLAGS(a, b))
COMPARE(CMP, DIFFERENCE_FLAGS(a, b))

#define SHIFT(name, type) \
    HANDLE(name##_I) { \
        uint8_t unused = 0; \
        RESULT(shifted(r[op->m], type, op->shift, unused)); \
    } \
    HANDLE(name##S_I) { RESULT_NZ(shifted(r[op->m], type, op->shift, carry)); } \
    HANDLE(name##_V) { \
        uint8_t unused = 0; \
        RESULT(shifted_by_register(r[op->m], type, r[op->a], unused)); \
    } \
    HANDLE(name##S_V) { RESULT_NZ(shifted_by_register(r[op->m], type, r[op->a], carry)); }

SHIFT(LSL, 0)
SHIFT(LSR, 1)
SHIFT(ASR, 2)
SHIFT(ROR, 3)

// Results in SP: its two low bits stay 0 (B1.4.1). Flags are of the whole sum.
#define ADD_TO_SP(y, carry_in, sets_flags) \
    do { \
        if (sets_flags) { \
            SUM_FLAGS(r[13], y, carry_in); \
            r[13] = total & ~3u; \
        } else { \
            r[13] = (r[13] + (y) + (carry_in)) & ~3u; \
        } \
        NEXT(1); \
    } while (0)
HANDLE(ADD_SP_I) {
    const uint32_t b = op->m ? ~op->value : op->value;
    ADD_TO_SP(b, (uint32_t)op->m, op->a);
}
HANDLE(ADD_SP_X) {
    uint8_t unused = carry;
    const uint32_t b = SHIFTED_M(unused);
    ADD_TO_SP(b, 0u, op->list);
}
HANDLE(SUB_SP_X) {
    uint8_t unused = carry;
    const uint32_t b = SHIFTED_M(unused);
    ADD_TO_SP(~b, 1u, op->list);
}
// SP or PC is the result, or PC is read.
HANDLE(ADD_HIGH) {
    const uint32_t pc = PC;
    r[15] = pc + 4;
    const uint32_t result = r[op->n] + r[op->m];
    if (op->d == 15) GO(result & ~1u, REFILL_REGISTER);
    r[op->d] = op->d == 13 ? result & ~3u : result;
    NEXT(1);
}
HANDLE(MOV_HIGH) {
    const uint32_t pc = PC;
    r[15] = pc + 4;
    const uint32_t result = r[op->m];
    if (op->d == 15) {
        r[15] = pc;
        GO(result & ~1u, REFILL_REGISTER);
    }
    r[op->d] = op->d == 13 ? result & ~3u : result;
    NEXT(1);
}
HANDLE(ADR) { RESULT(((PC + 4) & ~3u) + op->value); }
HANDLE(MOVT) { RESULT((r[op->d] & 0xFFFF) | op->value << 16); }

HANDLE(MUL) { RESULT(r[op->n] * r[op->m]); }
HANDLE(MULS) { RESULT_NZ(r[op->n] * r[op->m]); }
HANDLE(MLA) {
    r[op->d] = r[op->n] * r[op->m] + r[op->a];
    NEXT(2);
}
HANDLE(MLS) {
    r[op->d] = r[op->a] - r[op->n] * r[op->m];
    NEXT(2);
}
// `product`: 64 bits of a and b; `size`: the operand whose size determines the cycles.
#define LONG_MULTIPLY(name, product, size) \
    HANDLE(name##MULL) { \
        const uint32_t a = r[op->n], b = r[op->m]; \
        const uint64_t result = (product); \
        r[op->a] = (uint32_t)result, r[op->d] = (uint32_t)(result >> 32); \
        NEXT(long_multiply_cycles(size(a), size(b))); \
    } \
    HANDLE(name##MLAL) { \
        const uint32_t a = r[op->n], b = r[op->m], high = r[op->d]; \
        const uint64_t result = (product) + ((uint64_t)high << 32 | r[op->a]); \
        r[op->a] = (uint32_t)result, r[op->d] = (uint32_t)(result >> 32); \
        NEXT(long_accumulate_cycles(size(a), size(b), size(high))); \
    }
LONG_MULTIPLY(U, (uint64_t)a * b, uint32_t)
LONG_MULTIPLY(S, (uint64_t)((int64_t)(int32_t)a * (int32_t)b), magnitude)
HANDLE(UDIV) {
    const uint32_t a = r[op->n], b = r[op->m];
    if (UNLIKELY(b == 0) && system->divide_trap()) FAIL(Fault::DivideByZero);
    r[op->d] = b ? a / b : 0;
    NEXT(divide_cycles(a, b));
}
HANDLE(SDIV) {
    const uint32_t a = r[op->n], b = r[op->m];
    if (UNLIKELY(b == 0) && system->divide_trap()) FAIL(Fault::DivideByZero);
    // The one overflow wraps (A7.7.127).
    r[op->d] = b == 0 ? 0 : b == 0xFFFFFFFFu ? 0u - a : (uint32_t)((int32_t)a / (int32_t)b);
    NEXT(divide_cycles(magnitude(a), magnitude(b)));
}

#define SATURATION_OPERAND() \
    (op->a ? (int32_t)r[op->n] >> (op->shift ? op->shift : 31) : (int32_t)(r[op->n] << op->shift))
HANDLE(SSAT) {
    const int64_t value = SATURATION_OPERAND(), top = ((int64_t)1 << (op->value - 1)) - 1;
    const int64_t result = value > top ? top : value < -top - 1 ? -top - 1 : value;
    if (result != value) saturated = 1;
    RESULT((uint32_t)result);
}
HANDLE(USAT) {
    const int64_t value = SATURATION_OPERAND(), top = ((int64_t)1 << op->value) - 1;
    const int64_t result = value > top ? top : value < 0 ? 0 : value;
    if (result != value) saturated = 1;
    RESULT((uint32_t)result);
}
HANDLE(BFI) {
    const uint32_t source = op->a ? 0 : r[op->n] << op->shift;
    RESULT((r[op->d] & ~op->value) | (source & op->value));
}
HANDLE(SBFX) { RESULT((uint32_t)((int32_t)(r[op->n] << op->value) >> op->list)); }
HANDLE(UBFX) { RESULT(r[op->n] << op->value >> op->list); }
HANDLE(CLZ) { RESULT(leading_zeros(r[op->m])); }
HANDLE(RBIT) {
    uint32_t v = __builtin_bswap32(r[op->m]);
    v = (v >> 4 & 0x0F0F0F0Fu) | (v & 0x0F0F0F0Fu) << 4;
    v = (v >> 2 & 0x33333333u) | (v & 0x33333333u) << 2;
    RESULT((v >> 1 & 0x55555555u) | (v & 0x55555555u) << 1);
}
HANDLE(REV) { RESULT(__builtin_bswap32(r[op->m])); }
HANDLE(REV16) {
    const uint32_t v = r[op->m];
    RESULT((v >> 8 & 0x00FF00FFu) | (v & 0x00FF00FFu) << 8);
}
HANDLE(REVSH) { RESULT((uint32_t)(int16_t)__builtin_bswap16((uint16_t)r[op->m])); }
HANDLE(SXTB) { RESULT((uint32_t)(int8_t)rotated(r[op->m], op->shift)); }
HANDLE(SXTH) { RESULT((uint32_t)(int16_t)rotated(r[op->m], op->shift)); }
HANDLE(UXTB) { RESULT((uint8_t)rotated(r[op->m], op->shift)); }
HANDLE(UXTH) { RESULT((uint16_t)rotated(r[op->m], op->shift)); }
