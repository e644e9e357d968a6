// Decoded operations and their handlers. Operation's fields by family:
//   data processing   d = result, n = first operand, then value (I: constant; its carry, if any, is
//                     bit 31 and `shift` is 1), m (R: register), m with a = type, shift = amount
//                     (X: shifted by a constant) or a = register with the amount (LSL_V, ...)
//   loads, stores     d = data, n = base, value = offset (O: offset, P: before, Q: after, with the
//                     base written back) or m << shift (M); L: value from the aligned PC
//   LDM, STM          value = bytes
//   branches          value = distance from the instruction's own address

#pragma once

#include <cstdint>

namespace armv7m {

// Every operation with three operand forms, with and without flags.
#define ARMV7M_LOGIC(X) X(AND) X(BIC) X(ORR) X(ORN) X(EOR)
#define ARMV7M_ARITHMETIC(X) X(ADD) X(ADC) X(SUB) X(SBC) X(RSB)
#define ARMV7M_TESTS(X) X(TST) X(TEQ) X(CMN) X(CMP)
#define ARMV7M_SHIFTS(X) X(LSL) X(LSR) X(ASR) X(ROR)
#define ARMV7M_LOADS(X) X(LDR) X(LDRH) X(LDRB) X(LDRSH) X(LDRSB)
#define ARMV7M_STORES(X) X(STR) X(STRH) X(STRB)
#define ARMV7M_CONDITIONS(X) \
    X(EQ) X(NE) X(CS) X(CC) X(MI) X(PL) X(VS) X(VC) X(HI) X(LS) X(GE) X(LT) X(GT) X(LE)

#define ARMV7M_THREE(X, op) X(op##_I) X(op##_R) X(op##_X)
#define ARMV7M_SIX(X, op) ARMV7M_THREE(X, op) X(op##S_I) X(op##S_R) X(op##S_X)
#define ARMV7M_FOUR(X, op) X(op##_O) X(op##_M) X(op##_P) X(op##_Q)

// All codes, in the order of their numbers. The first four are markers, not instructions.
#define ARMV7M_CODES(X) \
    X(UNDECODED) X(BREAK) X(REGION_END) X(FETCH) \
    ARMV7M_SIX(X, AND) ARMV7M_SIX(X, BIC) ARMV7M_SIX(X, ORR) ARMV7M_SIX(X, ORN) \
    ARMV7M_SIX(X, EOR) ARMV7M_SIX(X, ADD) ARMV7M_SIX(X, ADC) ARMV7M_SIX(X, SUB) \
    ARMV7M_SIX(X, SBC) ARMV7M_SIX(X, RSB) ARMV7M_SIX(X, MOV) ARMV7M_SIX(X, MVN) \
    ARMV7M_THREE(X, TST) ARMV7M_THREE(X, TEQ) ARMV7M_THREE(X, CMN) ARMV7M_THREE(X, CMP) \
    X(LSL_I) X(LSLS_I) X(LSL_V) X(LSLS_V) X(LSR_I) X(LSRS_I) X(LSR_V) X(LSRS_V) \
    X(ASR_I) X(ASRS_I) X(ASR_V) X(ASRS_V) X(ROR_I) X(RORS_I) X(ROR_V) X(RORS_V) \
    X(ADD_SP_I) X(ADD_SP_X) X(SUB_SP_X) X(ADD_HIGH) X(MOV_HIGH) X(ADR) X(MOVT) \
    X(MUL) X(MULS) X(MLA) X(MLS) X(UMULL) X(SMULL) X(UMLAL) X(SMLAL) X(UDIV) X(SDIV) \
    X(SSAT) X(USAT) X(BFI) X(SBFX) X(UBFX) X(CLZ) X(RBIT) X(REV) X(REV16) X(REVSH) \
    X(SXTB) X(SXTH) X(UXTB) X(UXTH) \
    ARMV7M_FOUR(X, LDR) ARMV7M_FOUR(X, LDRH) ARMV7M_FOUR(X, LDRB) ARMV7M_FOUR(X, LDRSH) \
    ARMV7M_FOUR(X, LDRSB) ARMV7M_FOUR(X, STR) ARMV7M_FOUR(X, STRH) ARMV7M_FOUR(X, STRB) \
    X(LDR_L) X(LDRH_L) X(LDRB_L) X(LDRSH_L) X(LDRSB_L) \
    X(LDR_WIDE) X(LOAD_USER) X(STORE_USER) \
    X(LDM) X(STM) X(LDRD) X(STRD) X(LDREX) X(STREX) X(CLREX) \
    X(B) X(B_EQ) X(B_NE) X(B_CS) X(B_CC) X(B_MI) X(B_PL) X(B_VS) X(B_VC) X(B_HI) X(B_LS) \
    X(B_GE) X(B_LT) X(B_GT) X(B_LE) X(BL) X(BX) X(BLX) X(CBZ) X(CBNZ) X(TBB) X(TBH) X(IT) \
    X(NOP) X(WFE) X(WFI) X(SEV) X(BARRIER) X(ISB) X(CPS) X(MRS) X(MSR) X(SVC) X(BKPT) \
    X(COPROCESSOR) X(UNDEFINED)

enum Code : uint16_t {
#define ARMV7M_CODE(name) C_##name,
    ARMV7M_CODES(ARMV7M_CODE)
#undef ARMV7M_CODE
    CODE_COUNT
};

static_assert(CODE_COUNT <= 256, "Operation::code is a byte");

constexpr uint8_t LAST_MARKER = C_FETCH;

// A decoded instruction in the cache of decoded code; all zero: not decoded yet.
struct Operation {
    uint16_t entry;         // where the loop goes: handler(), or a marker; C_FETCH while the fetch
                            // of the instruction may cost something
    uint8_t code;           // the instruction, or a marker
    uint8_t in_it;          // the same in an IT block: most 16-bit instructions set no flags
    uint8_t d, n, m, a;
    uint32_t value;
    uint8_t stall : 1;      // the preceding instruction computes its address
    uint8_t halves : 2;     // its length in half-words
    uint8_t across : 1;     // 32 bits across two words: a branch here takes one cycle more
    uint8_t shift;
    uint16_t list;

    // Number of its handler, which exist for 16-bit and for 32-bit instructions.
    uint16_t handler() const { return (uint16_t)(code + (halves == 2 ? CODE_COUNT : 0)); }
    void mark(uint8_t marker) { entry = code = in_it = marker; }
};

static_assert(sizeof(Operation) == 16, "the loop computes addresses from it");

}  // namespace armv7m
