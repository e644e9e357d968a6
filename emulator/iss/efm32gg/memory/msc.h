// Memory system controller: flash programming, wait states, instruction cache.
// EFM32GG Reference Manual, chapter 7.
#pragma once

#include "armv7m/memory/bus.h"
#include "efm32gg/memory/flash_cells.h"
#include "efm32gg/part/part.h"

namespace efm32gg {

class Msc : public Peripheral {
public:
    static constexpr uint32_t CACHE_WORDS = 128;

    Msc(Part &part, const Instance &instance);

    void reset() override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;

    // Reports a core clock that is too fast for the wait states.
    void check_wait_states();

    // Cycles that the fetch of a word costs. Not called for words in the cache.
    uint32_t fetch(uint32_t address, bool sequential);
    // Wait states of a data access to flash or information; stalls the core while flash is busy.
    int64_t read_wait(uint32_t address);
    bool ignores_bus_writes() const { return reg(msc::CTRL) & msc::CTRL_BUSFAULT; }

    FlashCells cells;

private:
    armv7m::FetchLines lines{};
    uint32_t cache[CACHE_WORDS], missing[CACHE_WORDS];
    uint32_t wait_states = 0;
    uint32_t hits = 0, misses = 0;

    std::vector<uint32_t> wear;      // erasures by page since the part was created

    uint32_t address = 0;            // of the next write
    uint32_t data[2] = {};           // loaded by WDATA; two with WDOUBLE
    uint32_t loaded = 0, written = 0;
    bool sequence = false;           // WRITETRIG: data is written as soon as it is loaded
    bool triggered = false;          // the loaded data is written as soon as the array is free
    bool erasing = false;
    Event done = Event::of<&Msc::on_done>(this);
    Event word_timeout = Event::of<&Msc::on_word_timeout>(this);

    uint32_t words() const { return reg(msc::WRITECTRL) & msc::WRITECTRL_WDOUBLE ? 2 : 1; }
    bool busy() const { return reg(msc::STATUS) & msc::STATUS_BUSY; }

    bool counting() const { return reg(msc::STATUS) & msc::STATUS_PCRUNNING; }
    void invalidate_cache();
    void set_up_reads();
    void command(uint32_t value);
    void load_address();
    bool page_locked(uint32_t at) const;
    uint8_t *page(uint32_t at);
    void program();
    void note(uint32_t at, uint32_t size, uint32_t before, uint32_t after, bool erased,
              int64_t duration);
    void erase(uint32_t at, uint32_t size, int64_t time);
    void occupy(int64_t time);
    void release();
    void set_data_ready(bool ready);
    void on_done(int64_t time);
    void on_word_timeout(int64_t time);
    void set_readable(bool readable);
};

}  // namespace efm32gg
