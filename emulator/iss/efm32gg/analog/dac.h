// Digital to analog converter. EFM32GG Reference Manual, chapter 29.
//
// A conversion takes two clocks of the DAC; its output is exact. Not modelled: sine mode, enabling
// by PRS, refresh (an output never drifts), the operational amplifiers.
#pragma once

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/prs.h"

namespace efm32gg {

class Dac : public Peripheral {
public:
    static constexpr int CHANNELS = 2;

    using Peripheral::Peripheral;

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;
    void prs_changed(int channel, bool level) override;

    // Volts of a channel inside of the part, for ADC and comparators; 0 if it is not led there.
    double internal_volts(int channel) const {
        return leads(channels[channel], INTERNAL) ? output(channel) : 0;
    }
    // Volts at a port pin (port * 16 + bit); NaN if no channel drives it.
    double pin_volts(int pin) const;
    // LESENSE supplies the data of a channel and leads it: to the pin (1), ADC and ACMPs (2), both
    // (3); it does not need to be enabled. 0 ends this.
    void sense(int channel, uint32_t code, uint32_t leads);

private:
    enum Lead : uint32_t { TO_PIN = 1, INTERNAL = 2 };

    struct Channel {
        Dac *dac;
        int number;
        bool converting = false, stalled = false, driven = false;
        uint32_t code = 0, next = 0;  // at the output, and after the conversion
        uint32_t sensed_code = 0, sensed_leads = 0;  // from LESENSE
        Event converted = Event::of<&Channel::on_converted>(this);

        void on_converted(int64_t) { dac->finish(*this); }
    };

    Channel channels[CHANNELS] = {{this, 0}, {this, 1}};

    uint32_t control(const Channel &one) const {
        return reg(dac::CH0CTRL + 4 * (uint32_t)one.number);
    }
    bool on(const Channel &one) const { return control(one) & dac::CH0CTRL_EN; }
    uint32_t valid(const Channel &one) const { return dac::STATUS_CH0DV << one.number; }
    bool leads(const Channel &one, Lead where) const {
        return (one.sensed_leads ? one.sensed_leads
                                 : field(reg(dac::CTRL), dac::CTRL_OUTMODE)) & where;
    }
    double reference() const;
    double output(int channel) const;
    void put(Channel &one, uint32_t code);
    void convert(Channel &one, bool triggered);
    void finish(Channel &one);
    void follow();
};

}  // namespace efm32gg
