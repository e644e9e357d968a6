// What the core needs of the memory system around it.
//
// Two ways lead out of the core. A Region is memory that the core reads and writes by itself; it
// also runs code from there, predecoded. Everything else is asked of the Bus, one call an access.
// The private peripheral bus (0xE0000000 to 0xE00FFFFF) goes to the System (system.h), and the
// bit-band aliases are resolved in the core: neither reaches the Bus.

#pragma once

#include <cstdint>

namespace armv7m {

// What instruction fetches from a region cost. Words whose line is in `tags` cost nothing; for any
// other the core calls Bus::fetch, which may enter the line. So a loop inside an instruction cache
// or a prefetch buffer runs without a call.
struct FetchLines {
    uint32_t *tags;       // tags[(address >> shift) & mask] == address >> shift: at hand
    uint32_t shift;       // log2 of the bytes of a line, 2 or more
    uint32_t mask;        // number of lines - 1
};

// Memory that the core accesses directly. The fast way is for regions that begin at a multiple of
// 1 MB; others work and are slower. Regions with the same `host` are aliases of each other.
struct Region {
    uint32_t base = 0;
    uint32_t size = 0;              // a multiple of 4
    uint8_t *host = nullptr;
    bool writable = true;           // if not, stores go to Bus::write
    bool readable = true;           // if not (flash being erased, no power), loads go to Bus::read,
                                    // and fetches from it to Bus::fetch_halfword
    uint8_t read_wait = 0;          // cycles that a load takes longer
    uint8_t write_wait = 0;         // likewise a store
    FetchLines *lines = nullptr;    // null: fetches cost nothing
};

class Bus {
public:
    virtual ~Bus() = default;

    // An access of 1, 2 or 4 bytes, aligned, that no region takes. False is a bus error. While it
    // runs, Cpu::cycles is the cycle of the data phase; what the slave waits it adds to that
    // (`cpu.cycles += n`). A smaller value is in the low bits, the others are 0.
    virtual bool read(uint32_t address, uint32_t size, uint32_t &value) = 0;
    virtual bool write(uint32_t address, uint32_t size, uint32_t value) = 0;

    // Cycles that the fetch of the word at `address` delays the program, for regions with lines.
    // `sequential`: the word before it was the last one fetched; else a branch led there.
    // Cpu::cycles says when.
    virtual uint32_t fetch(uint32_t address, bool sequential) {
        (void)address, (void)sequential;
        return 0;
    }

    // A half-word of code where there is no readable region. False is a bus error.
    virtual bool fetch_halfword(uint32_t address, uint32_t &value) {
        return read(address, 2, value);
    }

    // As read, for a debugger: no effect, no time. False where nothing can be said.
    virtual bool peek(uint32_t address, uint32_t size, uint32_t &value) {
        (void)address, (void)size, (void)value;
        return false;
    }
};

}  // namespace armv7m
