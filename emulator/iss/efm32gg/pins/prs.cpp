#include "efm32gg/pins/prs.h"

#include "efm32gg/pins/gpio.h"

#include <cstring>

namespace efm32gg {

using namespace prs;

void Prs::reset() {
    Peripheral::reset();
    std::memset(signals, 0, sizeof signals);
    levels = 0;
}

bool Prs::selects(int channel, int source, int signal) const {
    const uint32_t control = reg(CH0_CTRL + 4 * (uint32_t)channel);
    return (int)field(control, CH0_CTRL_SOURCESEL) == source &&
           (int)field(control, CH0_CTRL_SIGSEL) == signal;
}

bool Prs::listens(int source, int signal) const {
    for (int channel = 0; channel < CHANNELS; channel++)
        if (selects(channel, source, signal)) return true;
    return false;
}

// The input of a channel's edge detector; SWLEVEL inverts it (13.3.2).
bool Prs::input(int channel) const {
    const uint32_t control = reg(CH0_CTRL + 4 * (uint32_t)channel);
    const uint32_t source = field(control, CH0_CTRL_SOURCESEL);
    const bool signal = source && signals[source] >> field(control, CH0_CTRL_SIGSEL) & 1;
    return signal != (reg(SWLEVEL) >> channel & 1);
}

void Prs::set(int source, int signal, bool level) {
    const bool was = signals[source] >> signal & 1;
    if (was == level) return;
    for (int channel = 0; channel < CHANNELS; channel++) {
        if (!selects(channel, source, signal)) continue;
        const bool before = input(channel);
        signals[source] = (uint8_t)(signals[source] ^ 1 << signal);
        update(channel, before);
        signals[source] = (uint8_t)(signals[source] ^ 1 << signal);
    }
    signals[source] = (uint8_t)(signals[source] ^ 1 << signal);
}

void Prs::pulse(int source, int signal) {
    for (int channel = 0; channel < CHANNELS; channel++)
        if (selects(channel, source, signal))
            output_pulse(channel);
}

void Prs::write(uint32_t offset, uint32_t value) {
    if (offset == SWPULSE) {
        for (int channel = 0; channel < CHANNELS; channel++)
            if (value >> channel & 1)
                output_pulse(channel);
        return;
    }
    uint32_t before = 0;
    for (int channel = 0; channel < CHANNELS; channel++)
        before |= (uint32_t)input(channel) << channel;
    Peripheral::write(offset, value);
    for (int channel = 0; channel < CHANNELS; channel++)
        update(channel, before >> channel & 1);
}

void Prs::update(int channel, bool was) {
    const bool is = input(channel);
    if (is == was) return;
    const uint32_t detect = field(reg(CH0_CTRL + 4 * (uint32_t)channel), CH0_CTRL_EDSEL);
    if (detect == 0)
        output(channel, is);
    else if (detect & (is ? 1 : 2))
        output_pulse(channel);
}

void Prs::output_pulse(int channel) {
    output(channel, true);
    output(channel, false);
}

void Prs::output(int channel, bool level) {
    set_bits(levels, 1u << channel, level);
    if (channel < 4 && reg(ROUTE) >> channel & 1)
        part.gpio->function(ROUTES[route::PRS_CH0 + channel][field(reg(ROUTE), ROUTE_LOCATION)],
                            this, true, level);
    part.each([=](Peripheral &one) { one.prs_changed(channel, level); });
}

}  // namespace efm32gg
