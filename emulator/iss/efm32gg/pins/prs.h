// Peripheral reflex system: connects signals of peripherals to other peripherals. EFM32GG Reference
// Manual, chapter 13. Consumers are notified by Peripheral::prs_changed.
#pragma once

#include "efm32gg/pins/gpio.h"

#include <cstring>

namespace efm32gg {

class Prs : public Peripheral {
public:
    static constexpr int CHANNELS = 12;
    static constexpr int PINS = 48;    // source: pins 0 to 7; 8 to 15 are the next

    using Peripheral::Peripheral;

    void reset() override {
        Peripheral::reset();
        std::memset(signals, 0, sizeof signals);
        levels = 0;
        find_selected();
    }

    void write(uint32_t offset, uint32_t value) override {
        if (offset == prs::SWPULSE) {
            for (int channel = 0; channel < CHANNELS; channel++)
                if (value >> channel & 1)
                    output_pulse(channel);
            return;
        }
        part.gpio->change_heed([&] {
            uint32_t before = 0;
            for (int channel = 0; channel < CHANNELS; channel++)
                before |= (uint32_t)input(channel) << channel;
            Peripheral::write(offset, value);
            find_selected();
            for (int channel = 0; channel < CHANNELS; channel++)
                update(channel, before >> channel & 1);
        });
    }

    // Sets a producer's signal, or pulses it for one clock. Sources and signals have the numbers
    // of SOURCESEL and SIGSEL.
    void set(int source, int signal, bool level) {
        const bool was = signals[source] >> signal & 1;
        if (was == level) return;
        for (int channel = 0; channel < CHANNELS && selected >> source & 1; channel++) {
            if (!selects(channel, source, signal)) continue;
            const bool before = input(channel);
            signals[source] = (uint8_t)(signals[source] ^ 1 << signal);
            update(channel, before);
            signals[source] = (uint8_t)(signals[source] ^ 1 << signal);
        }
        signals[source] = (uint8_t)(signals[source] ^ 1 << signal);
    }

    // As `set` of each of these pins, while no channel selects any.
    bool listens_to_pins() const { return selected >> PINS & 3; }
    void note_pins(uint32_t pins, uint32_t levels) {
        for (int half = 0; half < 2; half++) {
            const uint8_t mask = (uint8_t)(pins >> 8 * half);
            uint8_t &noted = signals[PINS + half];
            noted = (uint8_t)((noted & ~mask) | (levels >> 8 * half & mask));
        }
    }

    void pulse(int source, int signal) {
        for (int channel = 0; channel < CHANNELS; channel++)
            if (selects(channel, source, signal))
                output_pulse(channel);
    }

    // Whether a channel selects that signal; units that count lazily schedule events for it.
    bool listens(int source, int signal) const {
        for (int channel = 0; channel < CHANNELS; channel++)
            if (selects(channel, source, signal)) return true;
        return false;
    }

    bool level(int channel) const { return levels >> channel & 1; }

private:
    uint8_t signals[64] = {};    // levels by source, one bit per signal
    uint32_t levels = 0;
    uint64_t selected = 0;       // sources that a channel selects, one bit each

    void find_selected() {
        selected = 0;
        for (int channel = 0; channel < CHANNELS; channel++)
            selected |= (uint64_t)1 << field(control(channel), prs::CH0_CTRL_SOURCESEL);
    }

    uint32_t control(int channel) const { return reg(prs::CH0_CTRL + 4 * (uint32_t)channel); }

    bool selects(int channel, int source, int signal) const {
        return (int)field(control(channel), prs::CH0_CTRL_SOURCESEL) == source &&
               (int)field(control(channel), prs::CH0_CTRL_SIGSEL) == signal;
    }

    // The input of a channel's edge detector; SWLEVEL inverts it (13.3.2).
    bool input(int channel) const {
        const uint32_t source = field(control(channel), prs::CH0_CTRL_SOURCESEL);
        const uint32_t number = field(control(channel), prs::CH0_CTRL_SIGSEL);
        const bool signal = source && signals[source] >> number & 1;
        return signal != (reg(prs::SWLEVEL) >> channel & 1);
    }

    void update(int channel, bool was) {
        const bool is = input(channel);
        if (is == was) return;
        const uint32_t detect = field(control(channel), prs::CH0_CTRL_EDSEL);
        if (detect == 0)
            output(channel, is);
        else if (detect & (is ? 1 : 2))
            output_pulse(channel);
    }

    void output(int channel, bool level) {
        set_bits(levels, 1u << channel, level);
        const uint32_t location = field(reg(prs::ROUTE), prs::ROUTE_LOCATION);
        if (channel < 4 && reg(prs::ROUTE) >> channel & 1)
            part.gpio->function(ROUTES[route::PRS_CH0 + channel][location], this, true, level);
        part.each([=](Peripheral &one) { one.prs_changed(channel, level); });
    }

    void output_pulse(int channel) {
        output(channel, true);
        output(channel, false);
    }
};

}  // namespace efm32gg
