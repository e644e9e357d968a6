// The EFM32GG280F1024 around its core: memories, address map, time, clocks, interrupt lines.
//
// EFM32GG Reference Manual, chapters 5 (memory and bus system), 9-11 (RMU, EMU, CMU).
//
// Time is in picoseconds. The core counts cycles of HFCORECLK; `cycle_time` converts one to the
// other exactly and restarts whenever that clock changes or stops.
#pragma once

#include "armv7m/memory/bus.h"
#include "armv7m/system/system.h"
#include "efm32gg/part/outbox.h"
#include "efm32gg/part/peripheral.h"

#include <memory>
#include <string>
#include <unordered_set>
#include <vector>

namespace efm32gg {

class Cmu;
class Dma;
class Emu;
class Rmu;
class Msc;
class Gpio;
class Ebi;
class Prs;
class I2c;
class SerialReceiver;
class Timer;
class Dac;
class SensorComparator;

enum class Clock { HFCORE, HFPER, HFCORELE, LFA, LFB, HFRCO, HFXO, AUXHFRCO, LFXO, LFRCO, ULFRCO };
constexpr int CLOCKS = 11;
using Rates = Rate[CLOCKS];

// Indices of the analog inputs: volts, and the temperature in degrees Celsius.
namespace analog {
enum Input {
    ADC0_CH0 = 0,     // to CH7: port D, bits 0 to 7
    TEMPERATURE = 8,
    VDD = 9,
    ACMP0_CH0 = 10,   // to CH7: port C, bits 0 to 7
    ACMP1_CH0 = 18,   // to CH7: port C, bits 8 to 15
    ADC0_REFERENCE = 26,  // at the pin for external references
    BACKUP_SUPPLY = 27,   // at BU_VIN
    COUNT = 32,
};
}  // namespace analog

// The caller owns the buffers. `information` has three pages: user data, lock bits, and the device
// information, which the part fills in; if it is null the part allocates its own.
struct Memories {
    uint8_t *flash, *ram, *information, *external;
    uint32_t flash_size, ram_size, external_size;
    const double *analog;  // volts and degrees Celsius; indices: analog::Input
};

// The circuit at the part's pins and external bus, when it is simulated in C++ and called directly.
class AttachedCircuit {
public:
    static constexpr int PORTS = 6;

    virtual ~AttachedCircuit() = default;

    // Pins that the circuit drives, and pins whose changes it receives in place of the outbox.
    uint32_t part_inputs[PORTS] = {}, part_outputs[PORTS] = {};

    // Levels of `port` at `now`; only bits in `part_inputs` count.
    virtual uint32_t input_levels(int port, int64_t now) = 0;

    // Outputs in `changed`, all in `part_outputs`, took `levels` at `now`.
    virtual void outputs_changed(int port, uint32_t changed, uint32_t levels, int64_t now) = 0;

    // What a change of a pin does (Gpio::heeds) is about to change, and has changed.
    virtual void heed_changing(int64_t now) = 0;
    virtual void heed_changed(int64_t now) = 0;

    // Access to one byte of the external bus beyond the part's own arrays; false: no answer.
    virtual bool bus_access(int bank, uint32_t address, uint8_t &value, bool write,
                            int64_t now) = 0;
};

class Part : public armv7m::Bus, public armv7m::SystemListener {
public:
    static constexpr uint32_t PAGE_BYTES = 4096;  // PAGE_SIZE is a macro of musl
    static constexpr uint32_t RAM = 0x20000000, RAM_CODE = 0x10000000, PERIPHERALS = 0x40000000;
    static constexpr uint32_t USER_PAGE = 0x0FE00000, LOCK_PAGE = 0x0FE04000,
                              INFORMATION = 0x0FE08000;

    // Bits of `exits` beside armv7m::Exit.
    enum : uint32_t { ExitAsleep = 1u << 16, ExitAwake = 1u << 17, ExitOutbox = 1u << 18 };

    // Cpu::system must already be set.
    Part(armv7m::Cpu &cpu, const Memories &memories);
    ~Part() override;
    static armv7m::SystemParameters system_parameters();

    armv7m::Cpu &cpu;
    const Memories memories;
    Outbox outbox;
    AttachedCircuit *attached = nullptr;

    // -- time --
    int64_t now() const;
    void schedule(Event &event, int64_t time);  // lowers the core's deadline if needed
    void schedule_after(Event &event, int64_t span) { schedule(event, later(now(), span)); }
    void cancel(Event &event) { events.remove(event); }
    int64_t next_event() const;

    // Runs up to `until`, or until the core falls asleep, wakes or stops, or a message in the
    // outbox requests a stop; `exits` has the reasons. After a bounded amount of work it returns
    // earlier, as at `until`.
    int64_t run(int64_t until);
    uint32_t exits = 0;

    // -- clocks --
    const Rate &rate(Clock clock) const { return rates[(int)clock]; }
    int64_t hertz(Clock clock) const { return rate(clock).whole_hertz(); }
    // The unit's clock: HFPERCLK with its enable bit, LFA or LFB after its prescaler, or
    // HFCORECLK. It is stopped when the unit is not enabled.
    Rate unit_rate(const Instance &instance) const;
    // Whether the unit's registers can be accessed.
    bool enabled(const Instance &instance) const;
    // `set` changes the inputs of the clock tree; all peripherals are notified before and after.
    template <class Set> void change_clocks(Set set) {
        each([](Peripheral &one) { one.clocks_changing(); });
        set();
        clocks_set();
        each([](Peripheral &one) { one.clocks_changed(); });
    }
    // Stops the core's clock until `until` (oscillator start-up).
    void stop_clock(int64_t until);
    // Makes the core wait for the flash.
    void stall(int64_t until);

    // -- interrupts, resets, sleep --
    void irq(int number, bool level);
    void reset(uint32_t cause);          // from outside: bits of rmu::RSTCAUSE
    void request_reset(uint32_t cause);  // from within: after the running instruction
    uint32_t reset_cause = 0;            // of the reset in progress
    int mode = 0;                        // energy mode, 0: awake
    void enter_em4();
    bool backup_lost = false;            // the backup domain had no power; until the next reset
    bool hung = false;                   // injected fault: no instructions until a reset

    // -- the bus, also for DMA: false is a bus fault; `wait` grows by the wait states --
    bool load(uint32_t address, int size, uint32_t &value, int64_t &wait);
    bool store(uint32_t address, int size, uint32_t value, int64_t &wait);
    bool read(uint32_t address, uint32_t size, uint32_t &value) override;
    bool write(uint32_t address, uint32_t size, uint32_t value) override;
    uint32_t fetch(uint32_t address, bool sequential) override;
    bool fetch_halfword(uint32_t address, uint32_t &value) override;
    bool peek(uint32_t address, uint32_t size, uint32_t &value) override;
    // Flash, RAM or information at `address`; `left`: number of bytes from there to its end.
    uint8_t *memory_at(uint32_t address, uint32_t &left);
    Peripheral *peripheral_at(uint32_t address) const;

    // -- outside --
    Outgoing &send(Kind kind, int unit, int64_t value, int64_t extra = 0, bool stop = true);
    // Reports each text once.
    void log_once(const char *format, ...) __attribute__((format(printf, 2, 3)));
    // The host's answer to a semihosting call; until then nothing runs and no time passes.
    void answer_call(uint32_t result);
    void analog_changed();
    double volts(int input) const { return memories.analog ? memories.analog[input] : 0; }
    // Serial bytes, for all blocks alike. Out: message UART with unit = block | pin << 8, where block
    // is an index of SERIAL_UNITS (interface/efm32gg/pins.py) and pin (port * 16 + bit) the TX pin
    // that ROUTE selects; none without a route to a pin that drives. In: here, once a character is
    // complete; `unit` is a block, or 0x100 | RX pin for the blocks that receive there.
    // `flags`: bit 0 framing error, bit 1 parity error; from bit 8 the line's bit rate, 0: unknown.
    void uart_receive(int unit, uint32_t data, uint32_t flags);
    // The I2C unit by number or by the pin of its SDA; null if none is routed there.
    I2c *i2c_unit(int unit) const;

    // -- armv7m::SystemListener --
    void reset_requested() override;
    void locked_up() override;
    void itm(int port, uint32_t value, int bytes) override;
    bool semihosting(uint32_t operation, uint32_t parameter) override;
    void unmodelled(const char *what) override { log_once("%s is not modelled", what); }

    // -- peripherals that others access --
    Cmu *cmu = nullptr;
    Dma *dma = nullptr;
    Emu *emu = nullptr;
    Rmu *rmu = nullptr;
    Msc *msc = nullptr;
    Gpio *gpio = nullptr;
    Ebi *ebi = nullptr;
    Prs *prs = nullptr;
    std::vector<SerialReceiver *> receivers;  // USARTs and LEUARTs, by unit number
    std::vector<I2c *> i2cs;
    std::vector<Timer *> timers;
    Dac *dac = nullptr;
    SensorComparator *comparators[2] = {};

    // Takes ownership of a peripheral.
    template <class Unit> Unit *add(Unit *unit) {
        place(*unit);
        owned.emplace_back(unit);
        return unit;
    }
    template <class Act> void each(Act act) {
        for (auto &one : owned)
            act(*one);
    }

private:
    static constexpr uint32_t SLOT = 0x400, SLOTS = 0xE4000 / SLOT;

    Schedule events;
    Rates rates;
    Rate cycle_time;
    int64_t base_cycle = 0;
    int64_t standing_until = 0;    // end of the core clock's stop; NEVER: until it wakes
    int64_t stalled_until = 0;     // end of the wait for the flash
    int64_t standing_now = 0;      // current time while the clock is stopped
    int64_t owed_cycles = 0;       // cycles counted during the stop, to be spent when it runs
    bool standing = true, stop_wanted = false, asleep = false, locked = false,
         calling = false;
    uint32_t wanted_reset = 0;
    int slow_ratio = 1;            // HFCORECLK to HFPERCLK
    std::vector<std::unique_ptr<Peripheral>> owned;
    Peripheral *slots[SLOTS] = {};
    std::vector<uint8_t> own_information;
    std::unordered_set<std::string> logged;
    uint8_t *information;

    void add_units();
    void place(Peripheral &unit);
    void clocks_set();
    void rebase(int64_t time);
    void advance(int64_t time);
    void perform_due(int64_t &steps);
    int64_t cycle_at(int64_t time) const;
    void fall_asleep();
    void wake(int64_t before);
    bool wait_for_wake(int64_t until);
    void perform_reset();
    bool access_allowed(const Peripheral &unit);
    int64_t bus_wait(const Peripheral &unit, bool write) const;
    void set_bus_waits();
};

// Add units that no other unit accesses; each is defined beside its unit.
void add_watchdog(Part &part);
// `source`: of DMA requests; `reflex`: of PRS signals; `signals`: of the TX pin (route::Signal),
// the RX pin's follows. The order of the calls is that of the unit numbers.
void add_usart(Part &part, const Instance &instance, int source, int reflex, int signals);
void add_leuart(Part &part, const Instance &instance, int source, int signals);
void add_low_energy_timers(Part &part);
void add_pulse_counters(Part &part);
void add_adc(Part &part);
void add_aes(Part &part);
void add_comparators(Part &part);
void add_lesense(Part &part);

}  // namespace efm32gg
