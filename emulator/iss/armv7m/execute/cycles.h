// Cycle counts that depend on operands (Cortex-M3 TRM r2p0, section 3.3.1 and its notes).
//
// The TRM gives ranges for instructions that terminate early. These functions interpolate by the
// sizes of the operands between the TRM's extremes.
//
// How the loop charges loads and stores (section 3.3.2):
//  - a load takes 2 cycles, or 1 directly after a single load whose result is not part of its
//    address;
//  - a store takes 1 and completes in the write buffer: its data phase is the next cycle; a load
//    after it waits for the end of that, the data phase of another store follows it;
//  - with the offset in a register a store takes 2, or 1 directly after a load;
//  - with write-back a load does not overlap a load before it, and a store directly after a load
//    takes 2 (not in the TRM; measured on an STM32F103, github.com/jnk0le/random, pipeline cycle
//    test);
//  - both take 1 more if the preceding instruction computes their base or index;
//  - LDM, STM, LDRD, STRD, PUSH and POP take 1 and 1 per register, and overlap with nothing;
//  - unaligned halves and words are 2 or 3 accesses.
// A branch takes 1 and the refill of the pipeline: 1 if the decoder sees the target (B, BL, CBZ), 2
// if it is in a register, 3 if it was loaded or comes from a table; 1 more if the target is a
// 32-bit instruction across two words, and 3 at most.

#pragma once

#include <cstdint>

namespace armv7m {

inline uint32_t leading_zeros(uint32_t value) {
    return value ? (uint32_t)__builtin_clz(value) : 32;
}

// UDIV and SDIV: 2 to 12, by the number of bits of the quotient.
inline uint32_t divide_cycles(uint32_t dividend, uint32_t divisor) {
    const uint32_t a = leading_zeros(dividend), b = leading_zeros(divisor);
    if (divisor == 0 || a > b) return 2;
    return 4 + (b - a + 1) / 4;
}

// UMULL and SMULL: 3 to 5, one less for each operand that fits into 16 bits.
inline uint32_t long_multiply_cycles(uint32_t a, uint32_t b) {
    return 3 + (a >> 16 != 0) + (b >> 16 != 0);
}

// UMLAL and SMLAL: 4 to 7, of which one is for an addend of more than 32 bits.
inline uint32_t long_accumulate_cycles(uint32_t a, uint32_t b, uint32_t high) {
    return 4 + (a >> 16 != 0) + (b >> 16 != 0) + (high != 0);
}

inline uint32_t magnitude(uint32_t value) { return value >> 31 ? 0u - value : value; }

constexpr uint32_t REFILL_DIRECT = 1, REFILL_REGISTER = 2, REFILL_LOADED = 3;

}  // namespace armv7m
