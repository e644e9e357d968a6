// Data watchpoint and trace unit: the cycle counter, the counters of sleep and of exception
// overhead, and the comparators as plain registers; ARMv7-M Architecture Reference Manual C1.8.
// CPICNT, LSUCNT and FOLDCNT stay 0: the core does not tell where a cycle went.

#pragma once

#include <cstdint>

namespace armv7m {

class Dwt {
public:
    explicit Dwt(int comparators) : comparators(comparators) {}
    void reset();
    void set_trace_enabled(bool enabled, int64_t now);    // DEMCR.TRCENA: without it all stand
    void count_sleep(int64_t cycles) { sleep.count(cycles, control >> 19 & running()); }
    void count_exception(int64_t cycles) { exception.count(cycles, control >> 18 & running()); }

    uint32_t read(uint32_t offset, int64_t now) const;    // offset from 0xE0001000
    void write(uint32_t offset, uint32_t value, int64_t now);

private:
    enum : uint32_t { CTRL = 0x0, CYCCNT = 0x4, CPICNT = 0x8, EXCCNT = 0xC, SLEEPCNT = 0x10,
                      LSUCNT = 0x14, FOLDCNT = 0x18, COMPARATORS = 0x20 };

    struct Counter {
        uint8_t value = 0;
        void count(int64_t cycles, uint32_t enabled) {
            if (enabled & 1) value = (uint8_t)(value + cycles);
        }
    };

    uint32_t running() const { return traced; }
    bool counts() const { return traced && (control & 1); }

    int comparators;
    bool traced = false;
    uint32_t control = 0;
    uint32_t base = 0;        // CYCCNT, less the cycle it was set at while it counts
    Counter sleep, exception;
    struct { uint32_t value, mask, function; } comparator[16] = {};
};

}  // namespace armv7m
