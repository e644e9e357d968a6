// SysTick, computed from the cycle count when asked (ARMv7-M Architecture Reference Manual B3.3).

#pragma once

#include <cstdint>

namespace armv7m {

class SysTick {
public:
    SysTick(uint32_t calibration, int64_t reference_cycles)
        : calibration(calibration), reference_cycles(reference_cycles) {}
    void reset();

    // The cycle at which the counter next reaches 0; INT64_MAX if it never does.
    int64_t next_wrap() const { return wrap; }

    // Brings COUNTFLAG up to `now`; true if the exception is to be pended.
    bool advance(int64_t now);

    uint32_t read(uint32_t offset, int64_t now);     // offset from 0xE000E010
    uint32_t peek(uint32_t offset, int64_t now) const;
    void write(uint32_t offset, uint32_t value, int64_t now);

private:
    uint32_t calibration;
    int64_t reference_cycles;
    uint32_t control = 0, reload = 0;
    int64_t wrap = INT64_MAX;
};

}  // namespace armv7m
