// The part's address map, for the core, DMA and debuggers. EFM32GG Reference Manual, chapter 5.
#include "armv7m/core/cpu.h"
#include "efm32gg/clocks/cmu.h"
#include "efm32gg/clocks/emu.h"
#include "efm32gg/memory/ebi.h"
#include "efm32gg/memory/msc.h"
#include "efm32gg/part/part.h"

#include <algorithm>
#include <cstring>

namespace efm32gg {

// Cycles of the bridge to the peripheral bus when peripherals run at the core's clock; a write
// completes in the background (chapter 5.2.3).
static constexpr int64_t READ_WAIT = 2, WRITE_WAIT = 1;

void Part::set_bus_waits() {
    const Rate &core = rate(Clock::HFCORE), &slow = rate(Clock::HFPER);
    const double ratio = core.runs() && slow.runs() ? core.frequency() / slow.frequency() : 1;
    slow_ratio = std::max(1, (int)ratio);
}

int64_t Part::bus_wait(const Peripheral &unit, bool write) const {
    const int64_t wait = write ? WRITE_WAIT : READ_WAIT;
    return cmu->on_slow_bus(unit.instance) ? wait * slow_ratio : wait;
}

Peripheral *Part::peripheral_at(uint32_t address) const {
    const uint32_t slot = (address - PERIPHERALS) / SLOT;
    return address >= PERIPHERALS && slot < SLOTS ? slots[slot] : nullptr;
}

bool Part::access_allowed(const Peripheral &unit) {
    if (cmu->enabled(unit.instance)) return true;
    log_once("%s is accessed without its clock", unit.instance.name);
    return false;
}

uint8_t *Part::memory_at(uint32_t address, uint32_t &left) {
    const struct {
        uint32_t base, size;
        uint8_t *host;
    } blocks[] = {{0, memories.flash_size, memories.flash},
                  {RAM, memories.ram_size, memories.ram},
                  {RAM_CODE, memories.ram_size, memories.ram},
                  {USER_PAGE, PAGE_BYTES, information},
                  {LOCK_PAGE, PAGE_BYTES, information + PAGE_BYTES},
                  {INFORMATION, PAGE_BYTES, information + 2 * PAGE_BYTES}};
    for (const auto &block : blocks)
        if (block.host && address - block.base < block.size) {
            left = block.size - (address - block.base);
            return block.host + (address - block.base);
        }
    return nullptr;
}

static bool writable_memory(uint32_t address) { return address >= Part::RAM_CODE; }

bool Part::load(uint32_t address, int size, uint32_t &value, int64_t &wait) {
    uint32_t left;
    value = 0;
    if (ebi->covers(address)) return ebi->access(address, size, value, false, wait);
    if (const uint8_t *memory = address < PERIPHERALS ? memory_at(address, left) : nullptr) {
        if (left < (uint32_t)size) return false;
        if (!writable_memory(address))
            wait += msc->read_wait(address);
        std::memcpy(&value, memory, (size_t)size);
        return true;
    }
    if (Peripheral *unit = peripheral_at(address)) {
        wait += bus_wait(*unit, false);
        const uint32_t offset = (address - unit->instance.base) & ~3u;
        if (access_allowed(*unit) && offset < unit->layout.size)
            value = unit->read(offset) >> 8 * (address & 3);
        if (size < 4)
            value &= (1u << 8 * size) - 1;
        return true;
    }
    return false;
}

bool Part::store(uint32_t address, int size, uint32_t value, int64_t &wait) {
    uint32_t left;
    if (ebi->covers(address)) return ebi->access(address, size, value, true, wait);
    if (uint8_t *memory = address < PERIPHERALS ? memory_at(address, left) : nullptr) {
        if (!writable_memory(address)) return msc->ignores_bus_writes();
        if (left < (uint32_t)size) return false;
        std::memcpy(memory, &value, (size_t)size);
        cpu.invalidate(address, (uint32_t)size);
        return true;
    }
    if (Peripheral *unit = peripheral_at(address)) {
        wait += bus_wait(*unit, true);
        const uint32_t offset = (address - unit->instance.base) & ~3u;
        if (!access_allowed(*unit) || offset >= unit->layout.size) return true;
        if (size < 4) {
            const uint32_t shift = 8 * (address & 3), mask = ((1u << 8 * size) - 1) << shift;
            value = (unit->peek(offset) & ~mask) | (value << shift & mask);
        }
        unit->write(offset, value);
        return true;
    }
    return false;
}

// Most instructions that come here poll a register or walk through external memory.
__attribute__((flatten)) bool Part::read(uint32_t address, uint32_t size, uint32_t &value) {
    int64_t wait = 0;
    const bool answered = load(address, (int)size, value, wait);
    cpu.cycles += wait;
    return answered;
}

__attribute__((flatten)) bool Part::write(uint32_t address, uint32_t size, uint32_t value) {
    int64_t wait = 0;
    const bool answered = store(address, (int)size, value, wait);
    cpu.cycles += wait;
    return answered;
}

uint32_t Part::fetch(uint32_t address, bool sequential) {
    return msc->fetch(address, sequential);
}

bool Part::fetch_halfword(uint32_t address, uint32_t &value) {
    uint32_t left;
    if (const uint8_t *memory = memory_at(address, left)) {
        msc->read_wait(address);
        uint16_t half;
        std::memcpy(&half, memory, 2);
        value = half;
        return true;
    }
    return ebi->covers(address) && Part::read(address, 2, value);
}

bool Part::peek(uint32_t address, uint32_t size, uint32_t &value) {
    uint32_t left;
    value = 0;
    if (const uint8_t *memory = memory_at(address, left)) {
        if (left < size) return false;
        std::memcpy(&value, memory, size);
        return true;
    }
    if (const Peripheral *unit = peripheral_at(address)) {
        const uint32_t offset = (address - unit->instance.base) & ~3u;
        if (offset < unit->layout.size)
            value = unit->peek(offset) >> 8 * (address & 3);
        if (size < 4)
            value &= (1u << 8 * size) - 1;
        return true;
    }
    return ebi->peek(address, (int)size, value);
}

}  // namespace efm32gg
