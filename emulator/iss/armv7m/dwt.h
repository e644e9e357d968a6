// Data watchpoint and trace unit: the counters and the comparators' registers (ARMv7-M
// Architecture Reference Manual C1.8).

#pragma once

#include <cstdint>

namespace armv7m {

class Dwt {
public:
    explicit Dwt(int comparators) : comparators(comparators) {}
    void reset();
    uint32_t read(uint32_t offset, int64_t now) const;    // offset from 0xE0001000
    void write(uint32_t offset, uint32_t value, int64_t now);

private:
    int comparators;
};

}  // namespace armv7m
