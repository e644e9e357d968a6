// A decoded instruction, as the cache of decoded code holds it.

#pragma once

#include <cstdint>

namespace armv7m {

// What the fields mean depends on the code; see codes.h.
struct Operation {
    uint16_t code = 0;       // index of the handler; 0: not decoded yet
    uint16_t in_it = 0;      // handler within an IT block (no flags set by 16-bit instructions)
    uint8_t d = 0, n = 0, m = 0, a = 0;
    uint32_t value = 0;
    uint8_t size = 0;        // bytes: 2 or 4
    uint8_t shift = 0;
    uint16_t list = 0;
};

static_assert(sizeof(Operation) == 16);

}  // namespace armv7m
