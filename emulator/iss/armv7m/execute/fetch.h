// Fetches from a region with lines (memory/bus.h). The loop contains them.

#pragma once

#include "armv7m/core/cpu.h"
#include "armv7m/decode/codes.h"

namespace armv7m {

// The fetch of what overlaps a line that lost its words may cost something again.
inline void Cpu::fetch_again(uint32_t line) {
    const Code &code = codes[code_number];
    const uint32_t address = line << lines->shift, offset = address - code.base;
    if (address >> lines->shift != line || offset >= code.size) return;
    Operation *op = code.operations.get() + offset / 2;
    Operation *const end = op + (1u << lines->shift) / 2;
    for (op -= offset != 0; op != end; op++)
        if (op->entry > LAST_MARKER) op->entry = C_FETCH;
}

// Charges the fetch of an instruction. Returns whether the next fetch of it is free.
inline bool Cpu::fetch(uint32_t pc, uint32_t halves, int64_t &now) {
    uint32_t *const tags = lines->tags, shift = lines->shift, mask = lines->mask;
    const uint32_t first = pc >> shift, last = (pc + 2 * halves - 2) >> shift;
    for (uint32_t line = first; line <= last; line++) {
        if (line == fetched) continue;
        const uint32_t before = tags[line & mask];
        if (before != line) {
            const bool sequential = line == fetched + 1;
            if (lines->reported) {
                r[15] = pc, cycles = now;
                now += bus.fetch(line << shift, sequential);
            } else {
                now += lines->read(line, sequential, now);
                tags[line & mask] = line;
                fetch_again(before);
            }
        }
        fetched = line;
    }
    return tags[first & mask] == first && tags[last & mask] == last;
}

}  // namespace armv7m
