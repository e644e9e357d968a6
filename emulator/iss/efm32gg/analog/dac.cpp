#include "efm32gg/analog/dac.h"

#include <cmath>

namespace efm32gg {

using namespace dac;

namespace {

constexpr int SOURCE = 10, REFLEX = 6;
constexpr int64_t CONVERSION = 2;  // of a conversion (29.3.1)
// OUT0 and OUT1: data sheet, table of alternate functions.
constexpr int PINS[] = {1 * 16 + 11, 1 * 16 + 12};
enum Reference : uint32_t { V1_25, V2_5, SUPPLY };
// Largest codes: unsigned, and of a difference (29.3.5).
constexpr double FULL = 4095, FULL_DIFFERENCE = 2047;

}  // namespace

void Dac::reset() {
    Peripheral::reset();
    for (Channel &one : channels) {
        part.cancel(one.converted);
        one.converting = one.stalled = one.driven = false;
        one.code = one.next = one.sensed_code = one.sensed_leads = 0;
    }
    follow();
}

void Dac::write(uint32_t offset, uint32_t value) {
    switch (offset) {
    case CH0DATA: return put(channels[0], value);
    case CH1DATA: return put(channels[1], value);
    case COMBDATA:
        put(channels[0], field(value, COMBDATA_CH0DATA));
        return put(channels[1], field(value, COMBDATA_CH1DATA));
    }
    Peripheral::write(offset, value);
    if (offset == CTRL && value & (CTRL_SINEMODE | CTRL_OUTENPRS))
        part.log_once("DAC0: sine mode and enabling by PRS are not modelled");
    if (offset == CH0CTRL || offset == CH1CTRL)
        for (Channel &one : channels)
            convert(one, false);
    if (offset <= CH1CTRL)
        part.analog_changed();
    follow();
}

void Dac::put(Channel &one, uint32_t code) {
    reg(CH0DATA + 4 * (uint32_t)one.number) = code & CH0DATA_DATA;
    reg(STATUS) |= valid(one);
    convert(one, false);
    follow();
}

// Begins a conversion: at once, or `triggered` by PRS.
void Dac::convert(Channel &one, bool triggered) {
    if (!on(one) || one.converting) return;
    if (!triggered && (control(one) & CH0CTRL_PRSEN || !(reg(STATUS) & valid(one)))) return;
    if (triggered && !(reg(STATUS) & valid(one)))
        raise(IF_CH0UF << one.number);
    one.next = reg(CH0DATA + 4 * (uint32_t)one.number);
    reg(STATUS) &= ~valid(one);
    raise(IF_CH0 << one.number);
    one.converting = true;
    const Rate rate = clock_now();
    one.stalled = !rate.runs();
    if (!one.stalled)
        part.schedule_after(one.converted, rate.span(CONVERSION << field(reg(CTRL), CTRL_PRESC)));
}

void Dac::finish(Channel &one) {
    if (!clock_now().runs()) {
        one.stalled = true;
        return;
    }
    one.converting = false;
    one.driven = true;
    one.code = one.next;
    part.prs->pulse(REFLEX, one.number);
    convert(one, false);
    part.analog_changed();
    follow();
}

void Dac::clocks_changed() {
    for (Channel &one : channels)
        if (one.stalled && clock_now().runs()) {
            one.stalled = false;
            part.schedule(one.converted, part.now());
        }
}

void Dac::prs_changed(int channel, bool level) {
    if (!level) return;
    for (Channel &one : channels)
        if (control(one) & CH0CTRL_PRSEN &&
            (int)field(control(one), CH0CTRL_PRSSEL) == channel)
            convert(one, true);
    follow();
}

void Dac::sense(int channel, uint32_t code, uint32_t leads) {
    channels[channel].sensed_code = code & CH0DATA_DATA;
    channels[channel].sensed_leads = leads;
    part.analog_changed();
}

double Dac::reference() const {
    switch (field(reg(CTRL), CTRL_REFSEL)) {
    case V1_25: return 1.25;
    case V2_5: return 2.5;
    case SUPPLY: return part.volts(analog::VDD);
    default: return 0;
    }
}

// In a difference channel 0 has the code of both: OUT1 - OUT0 is the signed voltage, around half
// of the reference (29.3.5).
double Dac::output(int channel) const {
    const bool difference = reg(CTRL) & CTRL_DIFF;
    if (channels[channel].sensed_leads) return reference() * channels[channel].sensed_code / FULL;
    const Channel &one = channels[difference ? 0 : channel];
    if (!on(one) || !one.driven) return 0;
    if (!difference) return reference() * one.code / FULL;
    const int code = one.code & 0x800 ? (int)one.code - 0x1000 : (int)one.code;
    const double half = reference() * code / FULL_DIFFERENCE / 2;
    return reference() / 2 + (channel ? half : -half);
}

double Dac::pin_volts(int pin) const {
    for (int channel = 0; channel < CHANNELS; channel++) {
        const Channel &one = channels[reg(CTRL) & CTRL_DIFF ? 0 : channel];
        if (pin == PINS[channel] && leads(channels[channel], TO_PIN) &&
            (channels[channel].sensed_leads || (on(one) && one.driven)))
            return output(channel);
    }
    return NAN;
}

void Dac::follow() {
    for (const Channel &one : channels)
        part.dma->request(SOURCE, one.number, on(one) && !(reg(STATUS) & valid(one)));
    update_interrupts();
}

}  // namespace efm32gg
