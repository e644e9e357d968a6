// Data watchpoint and trace unit: the counters of cycles, sleep and exception overhead; the
// comparators are plain registers. ARMv7-M Architecture Reference Manual C1.8. CPICNT, LSUCNT and
// FOLDCNT stay 0.

#pragma once

#include <cstdint>

namespace armv7m {

class Dwt {
public:
    explicit Dwt(int comparators) : comparators(comparators) {}

    void reset() {
        control = base = 0;
        traced = false;
        sleep = exception = 0;
        for (auto &each : comparator) each = {0, 0, 0};
    }

    // DEMCR.TRCENA; off: counters stop.
    void set_trace_enabled(bool enabled, int64_t now) {
        const uint32_t cycles = read(CYCCNT, now);
        traced = enabled;
        write(CYCCNT, cycles, now);
    }

    void count_sleep(int64_t cycles) { count(sleep, 19, cycles); }
    void count_exception(int64_t cycles) { count(exception, 18, cycles); }

    // Offsets from 0xE0001000.
    uint32_t read(uint32_t offset, int64_t now) const {
        switch (offset) {
        case CTRL: return (uint32_t)comparators << 28 | control;
        case CYCCNT: return counts() ? base + (uint32_t)now : base;
        case EXCCNT: return exception;
        case SLEEPCNT: return sleep;
        }
        const uint32_t index = (offset - COMPARATORS) / 16;
        if (offset < COMPARATORS || index >= (uint32_t)comparators) return 0;
        switch (offset & 15) {
        case 0: return comparator[index].value;
        case 4: return comparator[index].mask;
        case 8: return comparator[index].function;
        default: return 0;
        }
    }

    void write(uint32_t offset, uint32_t value, int64_t now) {
        switch (offset) {
        case CTRL: {
            const uint32_t cycles = read(CYCCNT, now);
            const uint32_t enabled = ~control & value;    // a counter starts at 0, C1.8.7
            if (enabled >> 18 & 1) exception = 0;
            if (enabled >> 19 & 1) sleep = 0;
            control = value & 0x007F1FFF;
            write(CYCCNT, cycles, now);
            return;
        }
        case CYCCNT: base = counts() ? value - (uint32_t)now : value; return;
        case EXCCNT: exception = (uint8_t)value; return;
        case SLEEPCNT: sleep = (uint8_t)value; return;
        }
        const uint32_t index = (offset - COMPARATORS) / 16;
        if (offset < COMPARATORS || index >= (uint32_t)comparators) return;
        switch (offset & 15) {
        case 0: comparator[index].value = value; break;
        case 4: comparator[index].mask = value & 31; break;
        case 8: comparator[index].function = value & 0x000FFFAF; break;
        }
    }

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
