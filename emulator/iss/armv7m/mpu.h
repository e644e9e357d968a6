// Memory protection unit (ARMv7-M Architecture Reference Manual B3.5).

#pragma once

#include <cstdint>

namespace armv7m {

enum class Access : uint8_t { Read, Write, Fetch };

class Mpu {
public:
    static constexpr int MAX_REGIONS = 16;

    explicit Mpu(int regions) : regions(regions) {}
    void reset();

    // Whether anything is to be asked; test this first.
    bool enabled() const { return (control & 1) != 0; }

    // `unboosted`: the execution priority is not negative (HFNMIENA).
    bool allows(uint32_t address, Access access, bool privileged, bool unboosted) const;

    uint32_t read(uint32_t offset) const;    // offset from 0xE000ED90
    void write(uint32_t offset, uint32_t value);

private:
    struct Region { uint32_t base, attributes; };

    int regions;
    uint32_t control = 0, number = 0;
    Region region[MAX_REGIONS] = {};
};

}  // namespace armv7m
