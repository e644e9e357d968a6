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

    // Whether it checks accesses now; test this first. Off at a negative execution priority unless
    // HFNMIENA is set.
    bool enabled() const { return active; }

    // Not for the private peripheral bus, which is not protected.
    bool allows(uint32_t address, Access access, bool privileged) const;

    // Execute-never by the default memory map, with or without an MPU (B3.1): peripherals,
    // devices, system. A fetch there is a Fault::FetchViolation.
    static bool execute_never(uint32_t address) {
        return address >= 0xA0000000u || (address >> 29) == 2;
    }

    uint32_t read(uint32_t offset) const;    // offset from 0xE000ED90
    // These return true if the result of enabled() or allows() may have changed.
    bool write(uint32_t offset, uint32_t value);
    bool set_negative_priority(bool negative);

private:
    enum : uint32_t { TYPE = 0x0, CTRL = 0x4, RNR = 0x8, RBAR = 0xC, RASR = 0x10,
                      ALIASES_END = 0x2C };
    enum : uint32_t { ENABLE = 1, HFNMIENA = 2, PRIVDEFENA = 4 };    // CTRL

    struct Region { uint32_t base, attributes; };

    // Rights of the 32 bytes at an address, as bits (access + 3 * privileged).
    uint8_t rights(uint32_t address) const;
    void forget();

    // Cached rights by 32 bytes, the size of the smallest region or subregion.
    static constexpr uint32_t LINES = 256;
    struct Line { uint32_t tag; uint8_t rights; };

    int regions;
    uint32_t control = 0, number = 0;
    bool active = false, negative = false;
    Region region[MAX_REGIONS] = {};
    mutable Line lines[LINES];
};

}  // namespace armv7m
