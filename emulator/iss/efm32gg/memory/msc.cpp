#include "efm32gg/memory/msc.h"

#include "armv7m/core/cpu.h"
#include "efm32gg/memory/dma.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace efm32gg {

using namespace msc;

// Data sheet, 3.8: typical times.
static constexpr int64_t PROGRAM_TIME = 20 * MICROSECOND, ERASE_TIME = 20 * MILLISECOND,
                         MASS_ERASE_TIME = 20 * MILLISECOND;
// The longest pause between two words of a sequence (7.5.8, WORDTIMEOUT); here it begins when the
// first one is written.
static constexpr int64_t WORD_TIMEOUT = 30 * MICROSECOND;
static constexpr int DMA_SOURCE = 48, DMA_DATA = 0;  // MSCWDATA
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
    part.cancel(word_timeout);
    sequence = triggered = erasing = false;
    address = loaded = written = 0;
    set_data_ready(true);
    hits = misses = 0;
    invalidate_cache();
    set_readable(true);
    set_up_reads();
}

// -- reading --

void Msc::invalidate_cache() {
    std::fill(std::begin(cache), std::end(cache), NO_TAG);
    part.cpu.lines_changed();
}

// With the cache off only the latest word is in `lines`; while hits are counted none is, and the
// core calls fetch(). The prefetch unit requests the next word one cycle after a hit, which is
// assumed to be one cycle ago, or two with PREFETCH, with which the controller reads ahead as well.
void Msc::set_up_reads() {
    wait_states = WAIT_STATES[field(reg(READCTRL), READCTRL_MODE)];
    lines.shift = 2;
    lines.reported = counting();
    lines.tags = counting() ? missing : cache;
    lines.wait = wait_states, lines.ahead = reg(READCTRL) & READCTRL_PREFETCH ? 2 : 1;
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
    return lines.read(tag, sequential, part.cpu.cycles);
}

int64_t Msc::read_wait(uint32_t at) {
    if (busy() && !(reg(WRITECTRL) & WRITECTRL_RWWEN &&
                            (at ^ address) & part.memories.flash_size / 2))
        part.stall(done.pending() ? done.time : word_timeout.time);
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
        loaded = std::min(loaded + 1, words());
        data[loaded - 1] = value;
        if (loaded < words()) break;
        set_data_ready(false);
        triggered |= sequence;
        program();
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
        loaded = 0;
        set_data_ready(true);
    }
    if (value & WRITECMD_WRITEEND) {
        sequence = false;
        if (word_timeout.pending())
            release();
    }
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
    if (value & (WRITECMD_ERASEPAGE | WRITECMD_ERASEMAIN0 | WRITECMD_ERASEMAIN1) && busy()) {
        part.log_once("MSC: an erasure while the flash is busy is lost");
    } else if (value & WRITECMD_ERASEPAGE) {
        const uint32_t start = address & ~(Part::PAGE_BYTES - 1);
        if (page(start) && !page_locked(start) && start != Part::LOCK_PAGE)
            erase(start, Part::PAGE_BYTES, ERASE_TIME);
    } else if (value & (WRITECMD_ERASEMAIN0 | WRITECMD_ERASEMAIN1) && !reg(MASSLOCK)) {
        const uint32_t half = part.memories.flash_size / 2;
        erase(value & WRITECMD_ERASEMAIN0 ? 0 : half, half, MASS_ERASE_TIME);
    }
    if (value & (WRITECMD_WRITEONCE | WRITECMD_WRITETRIG | WRITECMD_ERASEPAGE))
        reg(STATUS) &= ~STATUS_WORDTIMEOUT;
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

// Writes the loaded words, with WDOUBLE both in the time of one (7.3.6). A sequence waits for the
// second one; WRITEONCE writes a single one, too, and leaves the other unchanged.
void Msc::program() {
    if (done.pending() || !triggered || !loaded || (sequence && loaded < words())) return;
    written = std::exchange(loaded, 0);
    triggered = false;
    set_data_ready(true);
    if (reg(STATUS) & (STATUS_INVADDR | STATUS_LOCKED) || !page(address) ||
        !page(address + 4 * (written - 1)))
        return;
    for (uint32_t n = 0; n < written; n++) {
        const uint32_t at = address + 4 * n;
        uint8_t *cell = page(at);
        uint32_t old;
        std::memcpy(&old, cell, 4);
        const uint32_t now = cells.changed(at, old, old & data[n]);
        if (data[n] & ~old)
            part.log_once("flash at 0x%X is written without erasure: bits stay 0", (unsigned)at);
        std::memcpy(cell, &now, 4);
        part.cpu.invalidate(at, 4);
        note(at, 4, old, now, false, PROGRAM_TIME);
        part.send(Kind::FLASH, 0, at, 4, false);
    }
    erasing = false;
    occupy(PROGRAM_TIME);
}

void Msc::erase(uint32_t at, uint32_t size, int64_t time) {
    uint8_t *start = page(at);
    for (uint32_t n = 0; n < size; n += 4) {
        uint32_t old;
        std::memcpy(&old, start + n, 4);
        const uint32_t now = cells.changed(at + n, old, 0xFFFFFFFF);
        std::memcpy(start + n, &now, 4);
    }
    part.cpu.invalidate(at, size);
    note(at, size, 0, 0xFFFFFFFF, true, time);
    for (uint32_t one = at; one < at + size && one < part.memories.flash_size;
         one += Part::PAGE_BYTES)
        wear[one / Part::PAGE_BYTES]++;
    part.send(Kind::FLASH, 1, at, size == Part::PAGE_BYTES && at < part.memories.flash_size
                                      ? wear[at / Part::PAGE_BYTES] : size, false);
    erasing = true;
    occupy(time);
}

void Msc::note(uint32_t at, uint32_t size, uint32_t before, uint32_t after, bool erased,
               int64_t duration) {
    cells.note({part.now(), duration, at, size, before, after, part.cpu.r[15], erased});
}

void Msc::occupy(int64_t time) {
    part.cancel(word_timeout);
    reg(STATUS) |= STATUS_BUSY;
    set_readable(false);
    part.schedule_after(done, time);
}

void Msc::release() {
    part.cancel(word_timeout);
    reg(STATUS) &= ~STATUS_BUSY;
    set_readable(true);
}

void Msc::set_data_ready(bool ready) {
    set_bits(reg(STATUS), STATUS_WDATAREADY, ready);
    part.dma->request(DMA_SOURCE, DMA_DATA, ready);
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
    if (!erasing)
        address += 4 * written;
    raise(erasing ? IF_ERASE : IF_WRITE);
    if (sequence && !erasing)
        part.schedule_after(word_timeout, WORD_TIMEOUT);
    else
        release();
    erasing = false;
    triggered |= sequence && loaded == words();
    program();
}

// The flash is free again; data that comes later waits for another command.
void Msc::on_word_timeout(int64_t) {
    sequence = triggered = false;
    reg(STATUS) |= STATUS_WORDTIMEOUT;
    release();
}

}  // namespace efm32gg
