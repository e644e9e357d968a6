// SysTick, computed from the cycle count on access (ARMv7-M Architecture Reference Manual B3.3).

#pragma once

#include <cstdint>

namespace armv7m {

class SysTick {
public:
    // `reference_cycles` core cycles are `reference_ticks` ticks of the external reference clock;
    // 0: no reference clock.
    SysTick(uint32_t calibration, int64_t reference_cycles, int64_t reference_ticks)
        : calibration(calibration), reference_cycles(reference_cycles),
          reference_ticks(reference_ticks) {}

    void reset() {
        control = reload = base_value = 0;
        base_tick = 0;
        count_flag = false;
        wrap = INT64_MAX;
    }

    // The cycle at which the exception is pended next; INT64_MAX if never.
    int64_t next_wrap() const { return wrap; }

    // Updates the counter and COUNTFLAG to `now`; true if the exception is to be pended.
    bool advance(int64_t now) {
        const int64_t zero = next_zero();
        if (zero == INT64_MAX || tick(now) < zero) return false;
        count_flag = true;
        // Count on from the last zero.
        const int64_t period = (int64_t)reload + 1;
        base_tick = zero + (reload ? (tick(now) - zero) / period * period : 0);
        base_value = 0;
        find_wrap();
        return (control & TICKINT) != 0;
    }

    // Offsets from 0xE000E010. Call advance() before write() and read().
    uint32_t read(uint32_t offset, int64_t now) {
        const uint32_t result = peek(offset, now);
        if (offset == CSR) count_flag = false;
        return result;
    }

    uint32_t peek(uint32_t offset, int64_t now) const {
        switch (offset) {
        case CSR: return control | (reference_cycles ? 0u : CLKSOURCE) |
                         (count_flag ? COUNTFLAG : 0u);
        case RVR: return reload;
        case CVR: return value(now);
        default: return calibration;
        }
    }

    void write(uint32_t offset, uint32_t value, int64_t now) {
        base_value = this->value(now);
        base_tick = tick(now);
        if (offset == CSR) {
            control = value & (ENABLE | TICKINT | CLKSOURCE);
            base_tick = tick(now);    // of the clock now selected
        } else if (offset == RVR) {
            reload = value & 0xFFFFFF;
        } else if (offset == CVR) {
            base_value = 0;    // whatever is written; no exception
            count_flag = false;
        }
        find_wrap();
    }

private:
    enum : uint32_t { CSR = 0x0, RVR = 0x4, CVR = 0x8, CALIB = 0xC };
    enum : uint32_t { ENABLE = 1, TICKINT = 2, CLKSOURCE = 4, COUNTFLAG = 1u << 16 };    // CSR

    bool counts() const { return control & 1; }
    bool by_reference() const { return reference_cycles && !(control & 4); }

    // Ticks passed at a cycle.
    int64_t tick(int64_t cycle) const {
        if (!by_reference()) return cycle;
        return (int64_t)((__int128)cycle * reference_ticks / reference_cycles);
    }

    // First cycle of a tick.
    int64_t cycle_of(int64_t tick) const {
        if (!by_reference()) return tick;
        const __int128 cycles = (__int128)tick * reference_cycles + reference_ticks - 1;
        return (int64_t)(cycles / reference_ticks);
    }

    // A tick; INT64_MAX if none.
    int64_t next_zero() const {
        if (!counts()) return INT64_MAX;
        if (base_value) return base_tick + base_value;
        return reload ? base_tick + reload + 1 : INT64_MAX;
    }

    uint32_t value(int64_t now) const {
        if (!counts()) return base_value;
        const int64_t passed = tick(now) - base_tick;
        if (passed <= base_value) return base_value - (uint32_t)passed;
        if (!reload) return 0;    // stays at 0, B3.3.1
        return reload - (uint32_t)((passed - base_value - 1) % ((int64_t)reload + 1));
    }

    void find_wrap() {
        const int64_t zero = next_zero();
        wrap = zero == INT64_MAX || !(control & TICKINT) ? INT64_MAX : cycle_of(zero);
    }

    uint32_t calibration;
    int64_t reference_cycles, reference_ticks;
    uint32_t control = 0, reload = 0;
    bool count_flag = false;
    uint32_t base_value = 0;                  // counter at base_tick; a 0 there is already handled
    int64_t base_tick = 0;
    int64_t wrap = INT64_MAX;
};

}  // namespace armv7m
