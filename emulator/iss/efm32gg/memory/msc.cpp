#include "efm32gg/memory/msc.h"

#include "armv7m/core/cpu.h"

#include <algorithm>
#include <cstring>

namespace efm32gg {

using namespace msc;

// Data sheet, 3.8: typical times.
static constexpr int64_t PROGRAM_TIME = 20 * MICROSECOND, ERASE_TIME = 20 * MILLISECOND,
                         MASS_ERASE_TIME = 20 * MILLISECOND;
static constexpr uint32_t MSC_UNLOCK = 0x1B71, MASS_UNLOCK = 0x631A;
// The fastest core clock for 0 and 1 wait states (7.3.3).
static constexpr int64_t FASTEST[] = {16000000, 32000000};
static constexpr uint32_t WAIT_STATES[] = {0, 1, 0, 1, 2, 2, 2, 2};
static constexpr uint32_t NO_TAG = 0xFFFFFFFF;

Msc::Msc(Part &part, const Instance &instance)
    : Peripheral(part, instance), wear(part.memories.flash_size / Part::PAGE_BYTES) {
    std::fill(std::begin(missing), std::end(missing), NO_TAG);
    invalidate_cache();
}

void Msc::reset() {
    Peripheral::reset();
    part.cancel(done);
    data_loaded = sequence = triggered = erasing = false;
    address = 0;
    hits = misses = 0;
    invalidate_cache();
    set_readable(true);
    set_up_reads();
}

// -- reading --

void Msc::invalidate_cache() { std::fill(std::begin(cache), std::end(cache), NO_TAG); }

// The core calls fetch() for words that are not in `lines`: with the cache off all but the latest
// word, and while hits are counted all words.
void Msc::set_up_reads() {
    wait_states = WAIT_STATES[field(reg(READCTRL), READCTRL_MODE)];
    lines.shift = 2;
    lines.tags = counting() ? missing : cache;
    lines.mask = reg(READCTRL) & READCTRL_IFCDIS ? 0 : CACHE_WORDS - 1;
    for (armv7m::Region &region : part.cpu.regions) {
        if (region.host != part.memories.flash) continue;
        region.lines = wait_states || counting() ? &lines : nullptr;
        region.read_wait = (uint8_t)wait_states;
    }
    part.cpu.regions_changed();
}

void Msc::check_wait_states() {
    const int64_t core = part.hertz(Clock::HFCORE);
    if (wait_states < 2 && core > FASTEST[wait_states])
        part.log_once("flash with WS%u at %d Hz: at most %d Hz", wait_states, (int)core,
                      (int)FASTEST[wait_states]);
}

// The array reads a word in 1 + wait_states cycles. The core's prefetch unit requests the next word
// as soon as it has the previous one; after a hit that is assumed to be one cycle ago, or two with
// PREFETCH, with which the controller reads ahead as well.
uint32_t Msc::fetch(uint32_t at, bool sequential) {
    const uint32_t tag = at >> 2, slot = tag & lines.mask;
    const bool caching = !(reg(READCTRL) & READCTRL_IFCDIS);
    if (cache[slot] == tag) {
        if (counting() && caching)
            hits++;
        return 0;
    }
    cache[slot] = tag;
    if (counting() && caching)
        misses++;
    const int64_t now = part.cpu.cycles;
    int64_t requested = now;
    if (sequential) {
        const int64_t ahead = reg(READCTRL) & READCTRL_PREFETCH ? 2 : 1;
        requested = tag == array_tag + 1 ? array_free + 1 : now - ahead;
    }
    array_tag = tag;
    array_free = std::max(requested + (int64_t)wait_states, now - 1);
    return (uint32_t)std::clamp<int64_t>(array_free - now, 0, wait_states);
}

int64_t Msc::read_wait(uint32_t at) {
    if (done.pending() && !(reg(WRITECTRL) & WRITECTRL_RWWEN &&
                            (at ^ address) & part.memories.flash_size / 2))
        part.stall(done.time);
    return wait_states;
}

// -- registers --

uint32_t Msc::peek(uint32_t offset) const {
    switch (offset) {
    case CACHEHITS: return hits & 0xFFFFF;
    case CACHEMISSES: return misses & 0xFFFFF;
    default: return Peripheral::peek(offset);
    }
}

void Msc::write(uint32_t offset, uint32_t value) {
    if (reg(LOCK) && (offset == CTRL || offset == READCTRL || offset == WRITECMD ||
                      offset == TIMEBASE))
        return report_locked();
    switch (offset) {
    case LOCK: lock(LOCK, value, MSC_UNLOCK); break;
    case MASSLOCK: lock(MASSLOCK, value, MASS_UNLOCK); break;
    case READCTRL:
        store(offset, value);
        set_up_reads();
        check_wait_states();
        break;
    case WDATA:
        if (!(reg(WRITECTRL) & WRITECTRL_WREN)) {
            part.log_once("MSC: WDATA without WRITECTRL.WREN is lost");
            break;
        }
        reg(WDATA) = value;
        data_loaded = true;
        reg(STATUS) &= ~(STATUS_WDATAREADY | STATUS_WORDTIMEOUT);
        if (sequence) {
            triggered = true;
            program();
        }
        break;
    case WRITECMD: command(value); break;
    case CMD:
        if (value & CMD_INVCACHE)
            invalidate_cache();
        if (value & CMD_STARTPC) {
            hits = misses = 0;
            reg(STATUS) |= STATUS_PCRUNNING;
            set_up_reads();
        }
        if (value & CMD_STOPPC) {
            reg(STATUS) &= ~STATUS_PCRUNNING;
            set_up_reads();
        }
        break;
    case WRITECTRL:
        store(offset, value);
        if (value & WRITECTRL_IRQERASEABORT)
            part.log_once("MSC: interrupts do not abort an erasure (IRQERASEABORT)");
        break;
    default:
        Peripheral::write(offset, value);
    }
}

// -- programming --

void Msc::command(uint32_t value) {
    if (value & WRITECMD_CLEARWDATA) {
        data_loaded = false;
        reg(STATUS) |= STATUS_WDATAREADY;
    }
    if (value & WRITECMD_WRITEEND)
        sequence = false;
    if (value & WRITECMD_ERASEABORT && erasing && done.pending()) {
        part.cancel(done);
        reg(STATUS) |= STATUS_ERASEABORTED;
        on_done(part.now());
    }
    if (!(reg(WRITECTRL) & WRITECTRL_WREN)) {
        if (value & ~(uint32_t)(WRITECMD_CLEARWDATA | WRITECMD_WRITEEND | WRITECMD_ERASEABORT))
            part.log_once("MSC: WRITECMD without WRITECTRL.WREN is lost");
        return;
    }
    if (value & WRITECMD_LADDRIM)
        load_address();
    if (value & (WRITECMD_ERASEPAGE | WRITECMD_ERASEMAIN0 | WRITECMD_ERASEMAIN1) && done.pending()) {
        part.log_once("MSC: an erasure while the flash is busy is lost");
    } else if (value & WRITECMD_ERASEPAGE) {
        const uint32_t start = address & ~(Part::PAGE_BYTES - 1);
        if (page(start) && !page_locked(start) && start != Part::LOCK_PAGE)
            erase(start, Part::PAGE_BYTES, ERASE_TIME);
    } else if (value & (WRITECMD_ERASEMAIN0 | WRITECMD_ERASEMAIN1) && !reg(MASSLOCK)) {
        const uint32_t half = part.memories.flash_size / 2;
        erase(value & WRITECMD_ERASEMAIN0 ? 0 : half, half, MASS_ERASE_TIME);
    }
    if (value & (WRITECMD_WRITEONCE | WRITECMD_WRITETRIG)) {
        sequence = value & WRITECMD_WRITETRIG;
        triggered = true;
        program();
    }
}

uint8_t *Msc::page(uint32_t at) {
    uint32_t left;
    if (at >= Part::INFORMATION) return nullptr;
    return part.memory_at(at, left);
}

// Lock bits: one word for 32 pages, 0 locks; word 126 is for the user data page (7.3.5).
bool Msc::page_locked(uint32_t at) const {
    const uint32_t number = at / Part::PAGE_BYTES;
    uint32_t left, word;
    const uint32_t where = at >= Part::USER_PAGE ? 126 * 32 : number;
    std::memcpy(&word, part.memory_at(Part::LOCK_PAGE + 4 * (where / 32), left), 4);
    return at != Part::LOCK_PAGE && !(word >> where % 32 & 1);
}

void Msc::load_address() {
    address = reg(ADDRB) & ~3u;
    reg(STATUS) &= ~(STATUS_INVADDR | STATUS_LOCKED | STATUS_ERASEABORTED);
    const uint32_t start = address & ~(Part::PAGE_BYTES - 1);
    if (!page(address))
        reg(STATUS) |= STATUS_INVADDR;
    else if (page_locked(start))
        reg(STATUS) |= STATUS_LOCKED;
}

void Msc::program() {
    if (done.pending() || !triggered || !data_loaded) return;
    uint8_t *cell = page(address);
    triggered = data_loaded = false;
    reg(STATUS) |= STATUS_WDATAREADY;
    if (!cell || reg(STATUS) & (STATUS_INVADDR | STATUS_LOCKED)) return;
    uint32_t old;
    std::memcpy(&old, cell, 4);
    const uint32_t now = old & reg(WDATA);
    if (reg(WDATA) & ~old)
        part.log_once("flash at 0x%X is written without erasure: bits stay 0", (unsigned)address);
    std::memcpy(cell, &now, 4);
    part.cpu.invalidate(address, 4);
    part.send(Kind::FLASH, 0, address, 4, false);
    erasing = false;
    busy(PROGRAM_TIME);
}

void Msc::erase(uint32_t at, uint32_t size, int64_t time) {
    std::memset(page(at), 0xFF, size);
    part.cpu.invalidate(at, size);
    for (uint32_t one = at; one < at + size && one < part.memories.flash_size;
         one += Part::PAGE_BYTES)
        wear[one / Part::PAGE_BYTES]++;
    part.send(Kind::FLASH, 1, at, size == Part::PAGE_BYTES && at < part.memories.flash_size
                                      ? wear[at / Part::PAGE_BYTES] : size, false);
    erasing = true;
    busy(time);
}

void Msc::busy(int64_t time) {
    reg(STATUS) |= STATUS_BUSY;
    set_readable(false);
    part.schedule(done, part.now() + time);
}

// Flash that is being written does not answer: the core's accesses then go through read_wait.
void Msc::set_readable(bool readable) {
    for (armv7m::Region &region : part.cpu.regions)
        if (region.host == part.memories.flash)
            region.readable = readable;
    part.cpu.regions_changed();
    if (readable && !(reg(READCTRL) & READCTRL_AIDIS))
        invalidate_cache();
}

void Msc::on_done(int64_t) {
    reg(STATUS) &= ~STATUS_BUSY;
    set_readable(true);
    if (!erasing)
        address += 4;
    raise(erasing ? IF_ERASE : IF_WRITE);
    erasing = false;
    program();
}

}  // namespace efm32gg
