// The slow path of memory accesses: everything but aligned accesses to plain memory without
// watchpoints. Also the accesses of a debugger.

#include "armv7m/core/cpu.h"
#include "armv7m/system/system.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace armv7m {

static constexpr uint32_t PAGE = 1u << 20;
static constexpr uint32_t MARK_SHIFT = 6;

// The bit-band aliases, 32 MB each (B3.1): 0x22000000 of SRAM, 0x42000000 of peripherals.
static bool in_bit_band(uint32_t address) {
    return address >> 25 == 0x11 || address >> 25 == 0x21;
}

static uint32_t bit_band_byte(uint32_t address) {
    return (address & 0xF0000000u) + (address >> 5 & 0xFFFFF);
}

static bool in_private_bus(uint32_t address) { return address >> 20 == 0xE00; }

void Cpu::FreeCode::operator()(Operation *operations) const { std::free(operations); }

Cpu::Code &Cpu::code_of(const Region &region) {
    for (Code &code : codes)
        if (code.host == region.host && code.size >= region.size) return code;
    // calloc: untouched pages take no memory. Two markers after the end stop even a 32-bit
    // instruction in the last half-word.
    const size_t count = region.size / 2 + 2;
    auto *operations = (Operation *)std::calloc(count, sizeof(Operation));
    const size_t blocks = (region.size >> MARK_SHIFT) + 1;
    codes.push_back({region.host, region.size, std::unique_ptr<Operation[], FreeCode>(operations),
                     std::unique_ptr<uint8_t[]>(new uint8_t[blocks]()), region.base, region.lines});
    for (size_t i = count - 2; i < count; i++) operations[i].mark(C_REGION_END);
    return codes.back();
}

void Cpu::regions_changed() {
    const bool guarded = system != nullptr && system->mpu.enabled();
    pages.assign(1u << 12, Page());
    for (uint32_t number = 0; number < pages.size() && !guarded && watches.empty(); number++)
        pages[number].outside = !in_private_bus(number * PAGE) && !in_bit_band(number * PAGE);
    for (const Region &region : regions) {
        for (uint32_t offset = 0; offset < region.size; offset += PAGE)
            pages[(region.base + offset) / PAGE].outside = false;
        if (region.size != 0)
            pages[(region.base + region.size - 1) / PAGE].outside = false;
        const Code &code = code_of(region);
        if (region.base % PAGE != 0) continue;    // accesses go through find_region
        for (uint32_t offset = 0; offset < region.size; offset += PAGE) {
            const uint32_t address = region.base + offset;
            Page &page = pages[address / PAGE];
            if (page.host != nullptr) continue;
            const uint32_t length = std::min(region.size - offset, PAGE);
            bool watched = guarded;
            for (const Watch &watch : watches)
                watched |= watch.address < address + length && address < watch.address + watch.size;
            page.host = region.host + offset;
            page.marks = code.marks.get() + (offset >> MARK_SHIFT);
            page.read_limit = region.readable && !watched ? length : 0;
            page.write_limit = region.writable && !watched ? length : 0;
            page.read_wait = region.read_wait, page.write_wait = region.write_wait;
        }
    }
    lines_changed();
    if (++changes == most_changes) lower_deadline(cycles);
    limit = INT64_MIN;
}

const Region *Cpu::find_region(uint32_t address, uint32_t size) const {
    for (const Region &region : regions)
        if (address - region.base < region.size && region.size - (address - region.base) >= size)
            return &region;
    return nullptr;
}

static void forget(Operation *operations, uint32_t offset, uint32_t size) {
    const uint32_t first = offset < 2 ? 0 : (offset - 2) / 2, last = (offset + size - 1) / 2;
    for (uint32_t i = first; i <= last; i++)
        if (operations[i].code != C_REGION_END) operations[i].entry = operations[i].code = C_UNDECODED;
}

void Cpu::written(const uint8_t *host, uint32_t size) {
    for (Code &code : codes) {
        const uint64_t offset = (uintptr_t)host - (uintptr_t)code.host;
        if (offset >= code.size) continue;
        const uint32_t length = (uint32_t)std::min<uint64_t>(size, code.size - offset);
        for (uint64_t block = offset >> MARK_SHIFT; block <= (offset + length - 1) >> MARK_SHIFT;
             block++) {
            if (!code.marks[block]) continue;
            const uint64_t from = std::max<uint64_t>(offset, block << MARK_SHIFT);
            const uint64_t to = std::min<uint64_t>(offset + length, (block + 1) << MARK_SHIFT);
            forget(code.operations.get(), (uint32_t)from, (uint32_t)(to - from));
        }
    }
}

void Cpu::invalidate(uint32_t address, uint32_t size) {
    if (size == 0) return;
    for (const Region &region : regions) {
        const int64_t from = std::max<int64_t>(address, region.base);
        const int64_t to = std::min<int64_t>((int64_t)address + size,
                                             (int64_t)region.base + region.size);
        if (from < to) written(region.host + (from - region.base), (uint32_t)(to - from));
    }
}

bool Cpu::note_watch(uint32_t address, uint32_t size, uint32_t value, bool write) {
    for (const Watch &watch : watches) {
        if (address >= watch.address + watch.size || watch.address >= address + size) continue;
        if (!(write ? watch.on_write : watch.on_read)) continue;
        watch_hit = {r[15], address, size, value, write};
        exits |= ExitWatchpoint;
        limit = INT64_MIN;
        return true;
    }
    return false;
}

// Whether a watchpoint stops the running instruction before this access. `executed`: instructions
// before it.
bool Cpu::stops_at_watch(uint32_t address, uint32_t size, uint32_t value, bool write,
                         uint64_t executed) {
    if (watches.empty() || (watched_at == r[15] && watched_count == executed)) return false;
    if (!write) peek(address, size, value);
    if (!note_watch(address, size, value, write)) return false;
    watched_at = r[15], watched_count = executed;
    return true;
}

// The accesses of instructions: a watchpoint stops before them.
Result Cpu::load_slowly(uint32_t address, uint32_t size, uint32_t &value, bool as_privileged,
                        uint64_t executed) {
    if (stops_at_watch(address, size, 0, false, executed)) return Result::Watched;
    return access_pieces(address, size, value, false, as_privileged);
}

Result Cpu::store_slowly(uint32_t address, uint32_t size, uint32_t value, bool as_privileged,
                         uint64_t executed) {
    if (stops_at_watch(address, size, value, true, executed)) return Result::Watched;
    return access_pieces(address, size, value, true, as_privileged);
}

// An aligned access; writes `value` or sets it.
Result Cpu::access(uint32_t address, uint32_t size, uint32_t &value, bool write, bool privileged) {
    fault_address = address;
    if (in_private_bus(address)) {
        const bool done = write ? system->write(address, (int)size, value)
                                : system->read(address, (int)size, value);
        return done ? Result::Done : Result::BusError;
    }
    if (system->mpu.enabled() &&
        !system->mpu.allows(address, write ? Access::Write : Access::Read, privileged))
        return Result::Violation;
    if (in_bit_band(address)) return access_bit(address, size, value, write);
    const Region *region = find_region(address, size);
    if (region != nullptr && (write ? region->writable : region->readable)) {
        uint8_t *host = region->host + (address - region->base);
        if (write) {
            std::memcpy(host, &value, size);
            written(host, size);
        } else {
            value = 0;
            std::memcpy(&value, host, size);
        }
        cycles += write ? region->write_wait : region->read_wait;
        return Result::Done;
    }
    // Host and target are both little-endian.
    const bool done = write ? bus.write(address, size, value) : bus.read(address, size, value);
    return done ? Result::Done : Result::BusError;
}

// Access through a bit-band alias (B3.1; TRM 4.3): a store reads, changes the bit and writes. The
// access below it has the same size and is aligned.
Result Cpu::access_bit(uint32_t address, uint32_t size, uint32_t &value, bool write) {
    const uint32_t byte = bit_band_byte(address), target = byte & ~(size - 1);
    const uint32_t bit = (address >> 2 & 7) + 8 * (byte - target);
    uint32_t content = 0;
    const bool privilege = privileged();
    const Result result = access(target, size, content, false, privilege);
    if (result != Result::Done) return result;
    if (!write) {
        value = content >> bit & 1;
        return Result::Done;
    }
    content = (content & ~(1u << bit)) | (value & 1) << bit;
    cycles++;    // the write follows the read on the bus
    return access(target, size, content, true, privilege);
}

Result Cpu::load(uint32_t address, uint32_t size, uint32_t &value, bool as_privileged) {
    const Result result = access_pieces(address, size, value, false, as_privileged);
    if (result == Result::Done && !watches.empty()) note_watch(address, size, value, false);
    return result;
}

Result Cpu::store(uint32_t address, uint32_t size, uint32_t value, bool as_privileged) {
    if (!watches.empty()) note_watch(address, size, value, true);
    return access_pieces(address, size, value, true, as_privileged);
}

// Splits an unaligned access into accesses of one or two bytes (TRM 3.3.2), unless it traps.
Result Cpu::access_pieces(uint32_t address, uint32_t size, uint32_t &value, bool write,
                          bool as_privileged) {
    if (!(address & (size - 1))) return access(address, size, value, write, as_privileged);
    if (system->unaligned_trap()) return Result::Unaligned;
    uint32_t assembled = 0, done = 0;
    while (done < size) {
        const uint32_t piece = (address + done) & 1 || size - done < 2 ? 1 : 2;
        uint32_t part = write ? value >> 8 * done & (piece == 1 ? 0xFF : 0xFFFF) : 0;
        const Result result = access(address + done, piece, part, write, as_privileged);
        if (result != Result::Done) return result;
        assembled |= part << 8 * done;
        done += piece;
        if (done < size) cycles++;
    }
    if (!write) value = assembled;
    return Result::Done;
}

bool Cpu::peek(uint32_t address, uint32_t size, uint32_t &value) {
    if (const Region *region = find_region(address, size)) {
        value = 0;
        std::memcpy(&value, region->host + (address - region->base), size);
        return true;
    }
    if (in_private_bus(address)) {
        const uint32_t word = system->peek(address & ~3u);
        value = word >> 8 * (address & 3) & (size == 4 ? 0xFFFFFFFFu : (1u << 8 * size) - 1);
        return true;
    }
    if (in_bit_band(address)) {
        uint32_t content;
        if (!peek(bit_band_byte(address), 1, content)) return false;
        value = content >> (address >> 2 & 7) & 1;
        return true;
    }
    return bus.peek(address, size, value);
}

bool Cpu::poke(uint32_t address, uint32_t size, uint32_t value) {
    if (const Region *region = find_region(address, size)) {
        uint8_t *host = region->host + (address - region->base);
        std::memcpy(host, &value, size);
        written(host, size);
        return true;
    }
    if (address & (size - 1)) return false;
    const int64_t before = cycles;
    const Result result = access(address, size, value, true, true);
    cycles = before;
    return result == Result::Done;
}

}  // namespace armv7m
