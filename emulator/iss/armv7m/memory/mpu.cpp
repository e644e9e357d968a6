#include "armv7m/memory/mpu.h"

namespace armv7m {

namespace {

constexpr uint8_t right(Access access, bool privileged) {
    return (uint8_t)(1u << ((int)access + 3 * privileged));
}

// Table B3-15: what AP allows, as bits of right(); reserved encodings allow nothing.
uint8_t rights_of(uint32_t attributes) {
    constexpr uint8_t reads = right(Access::Read, true), writes = right(Access::Write, true);
    constexpr uint8_t user_reads = right(Access::Read, false);
    constexpr uint8_t all = reads | writes | user_reads | right(Access::Write, false);
    constexpr uint8_t read_only = reads | user_reads;
    constexpr uint8_t BY_AP[8] = {0, reads | writes, reads | writes | user_reads, all,
                                  0, reads,          read_only,                   read_only};
    uint8_t rights = BY_AP[attributes >> 24 & 7];
    if (!(attributes >> 28 & 1)) {    // executing needs reading
        if (rights & reads) rights |= right(Access::Fetch, true);
        if (rights & user_reads) rights |= right(Access::Fetch, false);
    }
    return rights;
}

}  // namespace

void Mpu::reset() {
    control = number = 0;
    active = negative = false;
    for (Region &each : region) each = {0, 0};
    forget();
}

void Mpu::forget() {
    for (uint32_t n = 0; n < LINES; n++) lines[n] = {n + 1, 0};    // no address there has it
}

bool Mpu::set_negative_priority(bool now) {
    if (negative == now) return false;
    negative = now;
    const bool before = active;
    active = (control & ENABLE) && (!negative || (control & HFNMIENA));
    return active != before;
}

bool Mpu::allows(uint32_t address, Access access, bool privileged) const {
    const uint32_t tag = address >> 5;
    Line &line = lines[tag % LINES];
    if (line.tag != tag) line = {tag, rights(address)};
    return (line.rights & right(access, privileged)) != 0;
}

uint8_t Mpu::rights(uint32_t address) const {
    uint8_t found = 0;
    if (control & PRIVDEFENA)
        found = right(Access::Read, true) | right(Access::Write, true) | right(Access::Fetch, true);
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

uint32_t Mpu::read(uint32_t offset) const {
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

bool Mpu::write(uint32_t offset, uint32_t value) {
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

}  // namespace armv7m
