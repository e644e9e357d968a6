// The EFM32GG280F1024 around its core: memories, address map, time, clocks, interrupt lines.
//
// EFM32GG Reference Manual, chapters 5 (memory and bus system), 9-11 (RMU, EMU, CMU).
//
// Time is in picoseconds. The core counts cycles of HFCORECLK; `cycle_time` maps one to the other,
// exactly, and starts anew whenever that clock changes.
#pragma once

#include "outbox.h"
#include "peripheral.h"
#include "schedule.h"

namespace armv7m {
struct Cpu;
}

namespace efm32gg {

class Cmu;
class Emu;
class Rmu;
class Msc;
class Gpio;
class Ebi;
class Prs;

enum class Clock { HFCORE, HFPER, HFCORELE, LFA, LFB, AUXHFRCO, LFXO, LFRCO, ULFRCO, COUNT };

// What the supply of the part and its outside hand in. Buffers belong to the caller.
struct Memories {
    uint8_t *flash, *ram, *information, *external;
    uint32_t flash_size, ram_size, external_size;
    const double *analog;  // volts and degrees; indices as in analog.h
};

class Part {
public:
    static constexpr uint32_t FLASH_SIZE = 1 << 20, RAM_SIZE = 128 << 10, PAGE_SIZE = 4096;

    Part(armv7m::Cpu &cpu, const Memories &memories);
    ~Part();

    armv7m::Cpu &cpu;
    Memories memories;
    Outbox outbox;

    // -- time --
    int64_t now() const;
    void schedule(Event &event, int64_t time);  // the core's deadline follows
    void cancel(Event &event) { events.remove(event); }
    int64_t next_event() const { return events.next_time(); }

    // Runs up to `until` or to the next thing that the outside has to see; returns now().
    int64_t run(int64_t until);

    // -- clocks --
    const Rate &rate(Clock clock) const { return rates[(int)clock]; }
    int64_t hertz(Clock clock) const { return rate(clock).whole_hertz(); }
    // Of HFPERCLK with the instance's enable bit; LFA and LFB clocks behind the unit's prescaler
    // come of cmu().
    bool enabled(const Instance &instance) const;
    // The CMU's: every rate at once; tells all peripherals before and after.
    void change_clocks(const Rate (&wanted)[(int)Clock::COUNT]);

    // -- interrupts, resets, sleep --
    void irq(int number, bool level);
    void reset(uint32_t cause);  // one of rmu::RSTCAUSE's bits
    void sleep(bool deep);       // the core: WFI or WFE stays
    void wake();                 // the core: it goes on
    int mode = 0;                // energy mode

    // -- the bus, also for DMA: false is a bus fault. `wait` adds bus wait states --
    bool load(uint32_t address, int size, uint32_t &value, int64_t &wait);
    bool store(uint32_t address, int size, uint32_t value, int64_t &wait);
    bool peek(uint32_t address, int size, uint32_t &value) const;
    Peripheral *peripheral_at(uint32_t address) const;
    Peripheral *find(const char *name) const;

    // -- outside --
    Outgoing &send(Kind kind, int unit, int64_t value, int64_t extra = 0, bool stop = true);
    // Each text once.
    void log_once(const char *format, ...) __attribute__((format(printf, 2, 3)));

    // -- peripherals others talk to --
    Cmu &cmu();
    Emu &emu();
    Rmu &rmu();
    Msc &msc();
    Gpio &gpio();
    Ebi &ebi();
    Prs &prs();

    template <class Act> void each(Act act) {
        for (int n = 0; n < peripheral_count; n++)
            act(*peripherals[n]);
    }

private:
    Schedule events;
    Rate rates[(int)Clock::COUNT];
    Rate cycle_time;
    int64_t base_cycle = 0, asleep_at = 0;
    Peripheral *peripherals[96] = {};
    int peripheral_count = 0;
};

}  // namespace efm32gg
