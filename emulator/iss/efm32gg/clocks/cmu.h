// Clock management unit: oscillators, clock tree, enable bits. EFM32GG Reference Manual, chapter
// 11.
#pragma once

#include "efm32gg/part/synchronizer.h"

namespace efm32gg {

class Cmu : public Peripheral {
public:
    static constexpr uint32_t HFXO_HERTZ = 48000000, LF_HERTZ = 32768, ULFRCO_HERTZ = 1000;

    Cmu(Part &part, const Instance &instance);

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    uint32_t peek(uint32_t offset) const override;
    void clocks_changed() override;

    // The clock tree as the registers select it; rates begin at `now`.
    void rates(Rates &rates, int64_t now) const;
    Rate unit_rate(const Instance &instance) const;
    // Whether each rising edge at the first input of this pulse counter is its clock.
    bool clocked_by_pin(const Instance &instance) const;
    bool enabled(const Instance &instance) const {
        const Enable &enable = latest(instance);
        return !enable.mask || reg(enable.offset) & enable.mask;
    }
    // Whether a unit's registers are behind HFPERCLK.
    bool on_slow_bus(const Instance &instance) const {
        return latest(instance).offset == cmu::HFPERCLKEN0;
    }

    // Oscillators stop and start with the energy mode; after wake-up the core runs from HFRCO.
    void sleep(int mode) { sleeping = mode; }
    void wake();
    bool low_frequency_on() const;
    // AUXHFRCO's frequency, whether it runs or not: LESENSE starts it when it needs it.
    int64_t auxiliary_hertz() const { return hertz(*this, AUXHFRCO); }

private:
    enum Oscillators { HFRCO, HFXO, AUXHFRCO, LFRCO, LFXO, OSCILLATORS };
    enum { SYNCED = 4 };

    struct Oscillator {
        Cmu *cmu;
        int number;
        bool enabled, ready;
        Event started;
    };

    Oscillator oscillators[OSCILLATORS];
    int selected = HFRCO;      // of HFCLK
    int wanted = -1;           // selected, but not running yet
    int sleeping = 0;
    uint32_t effective[SYNCED] = {};   // LFACLKEN0 LFAPRESC0 LFBCLKEN0 LFBPRESC0 in effect
    uint32_t unsynchronised = 0;       // a bit for each of them that waits for synchronisation
    Synchronizer synchronised[2];      // LFA, LFB
    Event calibrated;
    uint32_t calibration_top = 0;
    Rate calibration_up;
    int64_t calibration_began = 0;
    struct Enable {
        const Instance *instance;
        uint32_t offset, mask;         // of its enable bit; 0: always on
        bool low_energy;
        int synced;                    // of its LF clock: index into `effective`, or -1
        uint32_t enable, prescaler;    // masks in `effective`; of pulse counters: enable and
                                       // select bits in PCNTCTRL
    };
    static const Enable UNITS[];
    // That of the unit accessed last, for loops that poll one unit.
    mutable const Instance *last = nullptr;
    mutable const Enable *last_enable = nullptr;

    static uint32_t hertz(const Cmu &cmu, int oscillator);
    Rate clock_of(int oscillator, int64_t now) const;
    Rate low_frequency(uint32_t select, bool ultra_low, int64_t now) const;
    bool running(int oscillator) const;
    static const Enable &enable_of(const Instance &instance);
    const Enable &latest(const Instance &instance) const {
        if (last != &instance) {
            last = &instance;
            last_enable = &enable_of(instance);
        }
        return *last_enable;
    }
    bool locked_register(uint32_t offset) const;
    uint32_t status() const;
    void command_oscillators(uint32_t value);
    void switch_on(int number);
    void on_started(int number);
    void select(int number);
    void synchronise();
    void on_synchronised(int domain);
    void start_calibration();
    void on_calibrated(int64_t time);
    void check_limits();
};

}  // namespace efm32gg
