// The core's interface to the memory system.
//
// A Region is memory that the core accesses directly; it also runs predecoded code from there. For
// everything else it calls the Bus, once per access. The private peripheral bus (0xE0000000 to
// 0xE00FFFFF) belongs to System, and the core resolves the bit-band aliases: neither reaches the
// Bus.

#pragma once

#include <algorithm>
#include <cstdint>

namespace armv7m {

// Cost of instruction fetches from a region: a cache or prefetch buffer before a slow array. Lines
// in `tags` cost nothing; others are read from the array and enter it. One region has these lines.
struct FetchLines {
    uint32_t *tags;       // tags[(address >> shift) & mask] == address >> shift: present
    uint32_t shift;       // log2 of the bytes of a line, 2 or more
    uint32_t mask;        // number of lines - 1
    bool reported;        // the core calls Bus::fetch for each line that is not in `tags`

    // The array reads a line in 1 + wait cycles. A sequential one was requested as soon as the one
    // before it was read, or `ahead` cycles ago if that came from `tags`.
    uint32_t wait, ahead;
    uint32_t latest;      // the line that the array read last
    int64_t free;         // the cycle at which that read ended

    // Cycles by which reading this line from the array delays the program. The branches let the
    // host go on before it knows `free`.
    uint32_t read(uint32_t line, bool sequential, int64_t now) {
        const bool next = sequential && line == latest + 1;
        latest = line;
        if (!next) {
            const int64_t late = sequential ? (int64_t)wait - ahead : wait;
            free = now + std::max<int64_t>(late, -1);
            return (uint32_t)std::max<int64_t>(late, 0);
        }
        const int64_t end = free + 1 + wait;
        if (__builtin_expect(end > now, 0)) {
            free = end;
            return (uint32_t)std::min<int64_t>(end - now, wait);
        }
        free = std::max(end, now - 1);
        return 0;
    }
};

// Memory that the core accesses directly. The fast path needs a region that begins at a multiple of
// 1 MB; others are slower. Regions with the same `host` are aliases of each other.
struct Region {
    uint32_t base = 0;
    uint32_t size = 0;              // a multiple of 4
    uint8_t *host = nullptr;
    bool writable = true;           // if not, stores go to Bus::write
    bool readable = true;           // if not (flash being erased), loads go to Bus::read, and
                                    // fetches to Bus::fetch_halfword
    uint8_t read_wait = 0;          // additional cycles of a load
    uint8_t write_wait = 0;         // and of a store
    FetchLines *lines = nullptr;    // null: fetches cost nothing
};

class Bus {
public:
    virtual ~Bus() = default;

    // An aligned access of 1, 2 or 4 bytes outside all regions. False is a bus error. During the
    // call Cpu::cycles is the cycle of the data phase; the slave adds its wait states to it.
    // Smaller values are in the low bits, the others are 0.
    virtual bool read(uint32_t address, uint32_t size, uint32_t &value) = 0;
    virtual bool write(uint32_t address, uint32_t size, uint32_t value) = 0;

    // Cycles by which the fetch of the line at `address` delays the program, for lines that are
    // reported. `sequential`: the previous line was fetched last; else a branch led there.
    virtual uint32_t fetch(uint32_t address, bool sequential) {
        (void)address, (void)sequential;
        return 0;
    }

    // A half-word of code outside readable regions. False is a bus error.
    virtual bool fetch_halfword(uint32_t address, uint32_t &value) {
        return read(address, 2, value);
    }

    // As read, for a debugger: no side effects, no time. False if there is nothing.
    virtual bool peek(uint32_t address, uint32_t size, uint32_t &value) {
        (void)address, (void)size, (void)value;
        return false;
    }
};

}  // namespace armv7m
