// A decoded instruction in the cache of decoded code.

#pragma once

#include <cstdint>

namespace armv7m {

// codes.h defines the fields; all zero means "not decoded yet".
struct Operation {
    uint16_t code;          // its handler
    uint8_t in_it;          // its handler in an IT block: most 16-bit instructions set no flags
    uint8_t stall;          // 1: the preceding instruction computes its address
    uint8_t d, n, m, a;
    uint32_t value;
    uint8_t halves;         // its length in half-words
    uint8_t shift;
    uint16_t list;
};

static_assert(sizeof(Operation) == 16, "the loop computes addresses from it");

}  // namespace armv7m
