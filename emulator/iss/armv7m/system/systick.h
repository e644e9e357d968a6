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
    void reset();

    // The cycle at which the exception is pended next; INT64_MAX if never.
    int64_t next_wrap() const { return wrap; }

    // Updates the counter and COUNTFLAG to `now`; true if the exception is to be pended.
    bool advance(int64_t now);

    // Offsets from 0xE000E010. Call advance() before write() and read().
    uint32_t read(uint32_t offset, int64_t now);
    uint32_t peek(uint32_t offset, int64_t now) const;
    void write(uint32_t offset, uint32_t value, int64_t now);

private:
    enum : uint32_t { CSR = 0x0, RVR = 0x4, CVR = 0x8, CALIB = 0xC };
    enum : uint32_t { ENABLE = 1, TICKINT = 2, CLKSOURCE = 4, COUNTFLAG = 1u << 16 };    // CSR

    bool counts() const { return control & 1; }
    bool by_reference() const { return reference_cycles && !(control & 4); }
    int64_t tick(int64_t cycle) const;        // ticks passed at a cycle
    int64_t cycle_of(int64_t tick) const;     // first cycle of a tick
    int64_t next_zero() const;                // tick; INT64_MAX if none
    uint32_t value(int64_t now) const;
    void find_wrap();

    uint32_t calibration;
    int64_t reference_cycles, reference_ticks;
    uint32_t control = 0, reload = 0;
    bool count_flag = false;
    uint32_t base_value = 0;                  // counter at base_tick; a 0 there is already handled
    int64_t base_tick = 0;
    int64_t wrap = INT64_MAX;
};

}  // namespace armv7m
