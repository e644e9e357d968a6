// Data watchpoint and trace unit: the counters of cycles, sleep and exception overhead; the
// comparators are plain registers. ARMv7-M Architecture Reference Manual C1.8. CPICNT, LSUCNT and
// FOLDCNT stay 0.

#pragma once

#include <cstdint>

namespace armv7m {

class Dwt {
public:
    explicit Dwt(int comparators) : comparators(comparators) {}
    void reset();
    void set_trace_enabled(bool enabled, int64_t now);    // DEMCR.TRCENA; off: counters stop
    void count_sleep(int64_t cycles) { count(sleep, 19, cycles); }
    void count_exception(int64_t cycles) { count(exception, 18, cycles); }

    uint32_t read(uint32_t offset, int64_t now) const;    // offset from 0xE0001000
    void write(uint32_t offset, uint32_t value, int64_t now);

private:
    enum : uint32_t { CTRL = 0x0, CYCCNT = 0x4, CPICNT = 0x8, EXCCNT = 0xC, SLEEPCNT = 0x10,
                      LSUCNT = 0x14, FOLDCNT = 0x18, COMPARATORS = 0x20 };

    void count(uint8_t &counter, int enable_bit, int64_t cycles) {
        if (traced && control >> enable_bit & 1) counter = (uint8_t)(counter + cycles);
    }
    bool counts() const { return traced && (control & 1); }

    int comparators;
    bool traced = false;
    uint32_t control = 0;
    uint32_t base = 0;        // CYCCNT; while it counts, minus the cycle at which it was set
    uint8_t sleep = 0, exception = 0;
    struct { uint32_t value, mask, function; } comparator[16] = {};
};

}  // namespace armv7m
