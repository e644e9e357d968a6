// Helpers of the 32-bit decoder.

#pragma once

#include "armv7m/decode/codes.h"
#include "armv7m/decode/decode.h"

namespace armv7m {

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
