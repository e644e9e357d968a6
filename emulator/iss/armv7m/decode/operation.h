// A decoded instruction, as the cache of decoded code holds it.

#pragma once

#include <cstdint>

namespace armv7m {

// codes.h says what the fields mean; all zero is "not decoded yet".
struct Operation {
    uint16_t code;          // its handler
    uint8_t in_it;          // its handler in an IT block, where most 16-bit instructions set no flags
    uint8_t stall;          // 1: the instruction in front computes the address that it needs
    uint8_t d, n, m, a;
    uint32_t value;
    uint8_t halves;         // its length in half-words
    uint8_t shift;
    uint16_t list;
};

static_assert(sizeof(Operation) == 16, "the loop finds the address by it");

}  // namespace armv7m
