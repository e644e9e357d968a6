// Memory protection unit (ARMv7-M Architecture Reference Manual B3.5).

#pragma once

#include <cstdint>

namespace armv7m {

enum class Access : uint8_t { Read, Write, Fetch };

class Mpu {
public:
    static constexpr int MAX_REGIONS = 16;

    explicit Mpu(int regions) : regions(regions) {}

    void reset() {
        control = number = 0;
        active = negative = false;
        for (Region &each : region) each = {0, 0};
        forget();
    }

    // Whether it checks accesses now; test this first. Off at a negative execution priority unless
    // HFNMIENA is set.
    bool enabled() const { return active; }

    // Not for the private peripheral bus, which is not protected.
    bool allows(uint32_t address, Access access, bool privileged) const {
        const uint32_t tag = address >> 5;
        Line &line = lines[tag % LINES];
        if (line.tag != tag) line = {tag, rights(address)};
        return (line.rights & right(access, privileged)) != 0;
    }

    // Execute-never by the default memory map, with or without an MPU (B3.1): peripherals,
    // devices, system. A fetch there is a Fault::FetchViolation.
    static bool execute_never(uint32_t address) {
        return address >= 0xA0000000u || (address >> 29) == 2;
    }

    // Offsets from 0xE000ED90.
    uint32_t read(uint32_t offset) const {
        if (!regions) return 0;
        const Region &selected = region[number];
        switch (offset) {
        case TYPE: return (uint32_t)regions << 8;
        case CTRL: return control;
        case RNR: return number;
        }
        if (offset >= ALIASES_END) return 0;
        return (offset - RBAR) & 4 ? selected.attributes : selected.base | number;
    }

    // These return true if the result of enabled() or allows() may have changed.
    bool write(uint32_t offset, uint32_t value) {
        if (!regions || offset == TYPE || offset >= ALIASES_END) return false;
        if (offset == CTRL) {
            control = value & (ENABLE | HFNMIENA | PRIVDEFENA);
            active = (control & ENABLE) && (!negative || (control & HFNMIENA));
        } else if (offset == RNR) {
            if ((int)(value & 0xFF) < regions) number = value & 0xFF;
            return false;
        } else if ((offset - RBAR) & 4) {
            region[number].attributes = value & 0x173FFF3Fu;
        } else {
            if (value & 0x10 && (int)(value & 15) < regions) number = value & 15;    // VALID
            region[number].base = value & ~31u;
        }
        forget();
        return true;
    }

    bool set_negative_priority(bool now) {
        if (negative == now) return false;
        negative = now;
        const bool before = active;
        active = (control & ENABLE) && (!negative || (control & HFNMIENA));
        return active != before;
    }

private:
    enum : uint32_t { TYPE = 0x0, CTRL = 0x4, RNR = 0x8, RBAR = 0xC, RASR = 0x10,
                      ALIASES_END = 0x2C };
    enum : uint32_t { ENABLE = 1, HFNMIENA = 2, PRIVDEFENA = 4 };    // CTRL

    struct Region { uint32_t base, attributes; };

    static constexpr uint8_t right(Access access, bool privileged) {
        return (uint8_t)(1u << ((int)access + 3 * privileged));
    }

    // Table B3-15: what AP allows, as bits of right(); reserved encodings allow nothing.
    static uint8_t rights_of(uint32_t attributes) {
        const uint8_t reads = right(Access::Read, true), writes = right(Access::Write, true);
        const uint8_t user_reads = right(Access::Read, false), read_only = reads | user_reads;
        const uint8_t all = reads | writes | user_reads | right(Access::Write, false);
        const uint8_t by_ap[8] = {0, uint8_t(reads | writes), uint8_t(reads | writes | user_reads),
                                  all, 0, reads, read_only, read_only};
        uint8_t rights = by_ap[attributes >> 24 & 7];
        if (!(attributes >> 28 & 1)) {    // executing needs reading
            if (rights & reads) rights |= right(Access::Fetch, true);
            if (rights & user_reads) rights |= right(Access::Fetch, false);
        }
        return rights;
    }

    // Rights of the 32 bytes at an address, as bits of right().
    uint8_t rights(uint32_t address) const {
        uint8_t found = 0;
        if (control & PRIVDEFENA)
            found = right(Access::Read, true) | right(Access::Write, true) |
                    right(Access::Fetch, true);
        for (int n = regions - 1; n >= 0; n--) {
            const uint32_t attributes = region[n].attributes;
            const uint32_t log2 = (attributes >> 1 & 31) + 1;
            if (!(attributes & 1) || log2 < 5) continue;
            const uint32_t mask = log2 == 32 ? 0 : ~0u << log2;
            if ((address ^ region[n].base) & mask) continue;
            if (log2 >= 8 && attributes >> (8 + (address >> (log2 - 3) & 7)) & 1) continue;
            found = rights_of(attributes);
            break;
        }
        const uint8_t fetches = right(Access::Fetch, true) | right(Access::Fetch, false);
        return execute_never(address) ? found & ~fetches : found;
    }

    void forget() {
        for (uint32_t n = 0; n < LINES; n++) lines[n] = {n + 1, 0};    // no address there has it
    }

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
