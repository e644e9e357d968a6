// From half-words to operations (ARMv7-M ARM A5, A7.7).

#pragma once

#include "armv7m/decode/operation.h"

#include <cstdint>

namespace armv7m {

// Whether this half-word begins a 32-bit instruction (A5.1).
inline bool is_wide(uint32_t half) { return half >> 11 >= 0x1D; }

// The operation of a 16-bit instruction, or of a 32-bit one. What the architecture leaves
// UNPREDICTABLE decodes to C_UNDEFINED unless a comment says otherwise: a UsageFault is the
// harmless choice, and no compiler emits it.
Operation decode_16(uint32_t half);
Operation decode_32(uint32_t first, uint32_t second);

// Operation::stall of the operation that was decoded at `offset` of a piece of code.
uint8_t address_stall(const Operation &op, const uint8_t *code, uint32_t offset);

// Whether an IT at `op`, `offset` bytes into its region, follows a 16-bit instruction. The length of
// one that was run before outlives its breakpoints, so that these change no cycle.
inline bool folds(uint32_t offset, const Operation *op) {
    return offset != 0 && op[-1].halves == 1;
}

}  // namespace armv7m
