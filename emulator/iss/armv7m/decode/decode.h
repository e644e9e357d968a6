// From half-words to operations (ARMv7-M ARM A5, A7.7).

#pragma once

#include "armv7m/decode/codes.h"

#include <cstdint>

namespace armv7m {

// Whether this half-word begins a 32-bit instruction (A5.1).
inline bool is_wide(uint32_t half) { return half >> 11 >= 0x1D; }

// Decode a 16-bit and a 32-bit instruction. UNPREDICTABLE instructions decode to C_UNDEFINED unless
// a comment says otherwise: a UsageFault is the safe choice, and compilers do not emit them.
Operation decode_16(uint32_t half);
Operation decode_32(uint32_t first, uint32_t second);

// Operation::stall of the operation at `offset` of a block of code.
uint8_t address_stall(const Operation &op, const uint8_t *code, uint32_t offset);

// Whether an IT at `op`, `offset` bytes into its region, follows a 16-bit instruction. The length
// stays when a breakpoint replaces an operation, so that breakpoints change no cycle.
inline bool folds(uint32_t offset, const Operation *op) {
    return offset != 0 && op[-1].halves == 1;
}

// Helpers of the 32-bit decoder.
inline Operation wide(uint32_t code, uint32_t d = 0, uint32_t n = 0, uint32_t m = 0,
                      uint32_t value = 0) {
    Operation op = {};
    op.code = op.in_it = (uint8_t)code;
    op.d = (uint8_t)d, op.n = (uint8_t)n, op.m = (uint8_t)m;
    op.value = value;
    op.halves = 2;
    return op;
}

inline Operation undefined_32() { return wide(C_UNDEFINED); }

Operation load_store_multiple(uint32_t first, uint32_t second);
Operation dual_or_exclusive(uint32_t first, uint32_t second);
Operation load_store_single(uint32_t first, uint32_t second);

}  // namespace armv7m
