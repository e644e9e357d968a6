// Low energy sensor interface: scans sensors with the comparators, without the core. EFM32GG
// Reference Manual, chapter 25.
//
// A scan measures the enabled channels in turn: start delay, excitation of a pin, measurement of
// the comparator's level or count of its rising edges, evaluation. Assumed where the manual has only
// a figure: the first periodic scan comes one period after START, the next channel begins when
// both excitation and measurement of the previous one are over. Not modelled: sampling with both
// comparators, warm-up times of comparators and DAC, bias control.
#pragma once

#include "efm32gg/analog/comparator.h"
#include "efm32gg/analog/dac.h"
#include "efm32gg/analog/lesense_results.h"
#include "efm32gg/part/low_energy.h"

namespace efm32gg {

class Lesense : public LowEnergy {
public:
    static constexpr uint32_t CHANNELS = 16;

    using LowEnergy::LowEnergy;

    void reset() override;
    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;
    void prs_changed(int channel, bool level) override;
    void analog_changed() override;

private:
    enum class Excitation : uint32_t { NONE, HIGH, LOW, DAC };
    struct Plan {
        int64_t excite, excited, measure, sample;  // times; NEVER once done
    };

    bool running = false, scanning = false, stopping = false;
    uint32_t to_scan = 0;       // channels of the scan still to be measured
    uint32_t channel = 0;       // being measured
    uint32_t configuration = 0; // index of its configuration registers
    Plan plan = {};
    bool counting = false, level = false;
    uint32_t edges = 0;
    uint32_t sensors = 0, sensor_count = 0;  // results for the decoder in this scan
    uint32_t previous_state = 0, decoded = 0;
    Rate clock;                 // of the unit, while it runs
    int64_t period_edge = 0;    // of `clock`, when the next scan is due
    ResultBuffer results;
    Event due = Event::of<&Lesense::on_due>(this);
    Event step = Event::of<&Lesense::on_step>(this);

    void apply(uint32_t offset, uint32_t value) override;
    void command(uint32_t value);

    // -- the sequencer --
    int64_t period() const;
    void plan_period();
    void on_due(int64_t);
    void begin_scan(int64_t time);
    void begin_channel(int64_t time);
    void plan_step();
    void on_step(int64_t);
    void end_channel(int64_t time);
    void end_scan();
    uint32_t configuration_of(uint32_t number) const;
    uint32_t configured(uint32_t first) const { return reg(first + 0x10 * configuration); }
    int64_t span(uint32_t cycles, bool high_frequency) const;

    // -- sensors --
    bool sense();
    void control_dac(bool on);
    void excite(bool on);
    void drive(int signal, bool enabled, Excitation how);
    void idle_pins();

    // -- results --
    void evaluate(uint32_t data);
    void store(uint32_t data);
    void decode(uint32_t input);
    uint32_t decoder_input() const;
    void pulse_decoder(uint32_t action, bool reversed);
    void follow();
};

}  // namespace efm32gg
