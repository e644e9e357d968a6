// Port pins: modes, levels, interrupts. EFM32GG Reference Manual, chapter 32.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Gpio : public Peripheral {
public:
    static constexpr int PORTS = 6, PINS = 16;

    using Peripheral::Peripheral;

    void reset() override;
    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;

    // Peripheral `owner` drives a pin (port * 16 + bit; -1 is no pin), or releases it. A second
    // driver of a pin is reported and takes it over.
    void function(int pin, const Peripheral *owner, bool driven, bool level);
    // Releases all locations of a signal (route::Signal).
    void release(int signal, const Peripheral *owner);

    // The level at a pin now, whatever drives it.
    bool level(int port, int bit) const { return levels[port] >> bit & 1; }
    bool input(int pin) const { return pin >= 0 && level(pin / PINS, pin % PINS); }
    // `pin` if its mode allows it to be read, or driven; else -1.
    int readable(int pin) const { return pin >= 0 && mode(pin / PINS, pin % PINS) != 0 ? pin : -1; }
    int drivable(int pin) const { return pin >= 0 && mode(pin / PINS, pin % PINS) >= 4 ? pin : -1; }

    // Calls Peripheral::pin_changed of `unit` for every change of a pin.
    void listen(Peripheral &unit) {
        change_heed([&] { listeners.push_back(&unit); });
    }

    // Whether a change of a pin may do more than change its level.
    bool heeds(int port, int bit) const;

    // Performs `set`, which may change what `heeds` returns.
    template <class Set> void change_heed(Set set) {
        if (part.attached) part.attached->heed_changing(part.now());
        set();
        if (part.attached) part.attached->heed_changed(part.now());
    }

    // Drives a pin from outside the part; level -1 releases it.
    void drive_from_outside(int port, int bit, int level);

protected:
    void update_interrupts() override;

private:
    struct Port {
        uint32_t functions = 0, function_levels = 0;    // pins that peripherals drive
        uint32_t outside = 0, outside_levels = 0;       // pins driven from outside
        uint32_t driven = 0, driven_levels = 0;         // pins that the part drives
        uint32_t enabled = 0;                           // pins whose mode allows reading
        uint32_t pushing = 0;                           // pins whose mode drives both levels
        uint32_t interrupting = 0;                      // pins that EXTIPSEL selects
    };

    Port ports[PORTS];
    uint32_t levels[PORTS] = {};
    const Peripheral *owners[PORTS * PINS] = {};
    std::vector<Peripheral *> listeners;

    static uint32_t at(int port, uint32_t offset) { return offset + 0x24 * (uint32_t)port; }
    uint32_t mode(int port, int bit) const;
    bool locked(uint32_t offset) const;
    void write_port(int port, uint32_t offset, uint32_t value);
    void refresh(int port, uint32_t pins);
    void set_levels(int port, uint32_t now_levels);
    // Whether changes of these pins of any port do more than change levels and PRS signals.
    bool heeded(uint32_t changed) const;
    void edge(int port, int bit, bool level);
    // The port that can interrupt with its pin `bit` (EXTIPSEL).
    int interrupting_port(int bit) const;
    void modes_changed(int port);
    void interrupts_selected();
    void check_em4(int port, int bit, bool level);
};

}  // namespace efm32gg
