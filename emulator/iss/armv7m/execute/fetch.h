// Fetches from a region with lines (memory/bus.h). The loop contains them.

#pragma once

#include "armv7m/core/cpu.h"
#include "armv7m/decode/codes.h"

#include <algorithm>

namespace armv7m {

// The fetch of what overlaps a line that lost its words may cost something again.
inline void Cpu::fetch_again(uint32_t line, uint32_t shift) {
    static_assert(C_FETCH == LAST_MARKER, "the smaller one of it and of an entry is a marker");
    const uint32_t address = line << shift, offset = address - home_base;
    if (address >> shift != line || offset >= home_size) return;
    Operation *op = home + offset / 2, *const end = op + (1u << shift) / 2;
    if (offset != 0 && op[-1].halves == 2) op--;    // across the line's begin
    do op->entry = std::min<uint16_t>(op->entry, C_FETCH);
    while (++op != end);
}

// Charges the fetch of an instruction. Returns whether the next fetch of it is free.
[[gnu::always_inline]] inline bool Cpu::fetch(uint32_t pc, uint32_t halves, int64_t &now) {
    FetchLines &from = *lines;
    uint32_t *const tags = from.tags, shift = from.shift, mask = from.mask;
    const uint32_t first = pc >> shift, last = (pc + 2 * halves - 2) >> shift;
    uint32_t before = fetched;
    for (uint32_t line = first; line <= last; before = line++) {
        const uint32_t present = tags[line & mask];
        if (line == before || line == present) continue;
        const bool sequential = line == before + 1;
        if (from.reported) {
            r[15] = pc, cycles = now, fetched = before;
            now += bus.fetch(line << shift, sequential);
        } else {
            now += from.read(line, sequential, now);
            tags[line & mask] = line;
            fetch_again(present, shift);
        }
    }
    fetched = last;
    return tags[first & mask] == first && tags[last & mask] == last;
}

}  // namespace armv7m
