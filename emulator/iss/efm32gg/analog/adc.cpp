// ADC: single conversions and scans. EFM32GG Reference Manual, chapter 28.
//
// Conversions are ideal: no noise, offset or gain error.
#include "efm32gg/analog/dac.h"
#include "efm32gg/memory/dma.h"
#include "efm32gg/part/part.h"
#include "efm32gg/pins/prs.h"

#include <algorithm>
#include <cmath>

namespace efm32gg {

using namespace adc;

namespace {

constexpr int SOURCE = 8, REFLEX = 8;
// Calibration in the device information: a temperature in degrees Celsius, and the sensor's reading
// at it with the 1.25 V reference, 12 bits, from bit 4 on (5.6).
constexpr uint32_t CALIBRATED_AT = 0x0FE081B2, CALIBRATED_READING = 0x0FE081BE;
// Codes per degree with that reference (data sheet, 3.10, TGRAD_ADCTH).
constexpr double CODES_PER_DEGREE = -6.27;

enum Selected : uint32_t { TEMPERATURE = 8, VDD_THIRD, VDD, VSS, REFERENCE_HALF, DAC0, DAC1 };
enum Reference : uint32_t { V1_25, V2_5, SUPPLY, V5_DIFF, EXTERNAL, EXTERNAL_TWICE, SUPPLY_TWICE };
enum Resolution : uint32_t { BITS_12, BITS_8, BITS_6, OVERSAMPLED };
enum WarmUp : uint32_t { NORMAL, FAST_BANDGAP, KEEP_SCAN_REFERENCE, KEEP_WARM };

constexpr int BITS[] = {12, 8, 6, 12};

class Adc : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override {
        Peripheral::reset();
        part.cancel(converted);
        single_wanted = scanning = converting = stalled = false;
        to_scan = 0;
        warm = false;
        warm_reference = ~0u;
        follow();
    }

    uint32_t read(uint32_t offset) override {
        const uint32_t value = peek(offset);
        if (offset == SINGLEDATA || offset == SCANDATA) {
            reg(STATUS) &= ~(offset == SINGLEDATA ? STATUS_SINGLEDV : STATUS_SCANDV);
            follow();
        }
        return value;
    }

    uint32_t peek(uint32_t offset) const override {
        switch (offset) {
        case SINGLEDATAP: return reg(SINGLEDATA);
        case SCANDATAP: return reg(SCANDATA);
        }
        return Peripheral::peek(offset);
    }

    void write(uint32_t offset, uint32_t value) override {
        Peripheral::write(offset, value);
        if (offset == CTRL && field(value, CTRL_WARMUPMODE) != KEEP_WARM)
            warm = false;
        if (offset != CMD) return;
        if (value & CMD_SINGLESTOP)
            single_wanted = false;
        else if (value & CMD_SINGLESTART)
            single_wanted = true;
        if (value & CMD_SCANSTOP)
            scanning = false, to_scan = 0;
        else if (value & CMD_SCANSTART && !scanning)
            start_scan();
        begin();
        follow();
    }

    void clocks_changed() override {
        if (stalled && clock_now().runs()) {
            stalled = false;
            part.schedule(converted, part.now());
        }
        begin();
        follow();
    }

    void prs_changed(int channel, bool level) override {
        if (!level) return;
        const auto triggered = [channel](uint32_t control) {
            return control & SINGLECTRL_PRSEN && (int)field(control, SINGLECTRL_PRSSEL) == channel;
        };
        const bool single = triggered(reg(SINGLECTRL)), scan = triggered(reg(SCANCTRL));
        if (!single && !scan) return;
        single_wanted |= single;
        if (scan && !scanning)
            start_scan();
        begin();
        follow();
    }

private:
    bool single_wanted = false, scanning = false, converting = false, stalled = false;
    bool single_running = false;   // the running conversion is a single one, not of a scan
    uint32_t to_scan = 0;          // channels of the scan still to be converted
    int scan_channel = 0;
    bool warm = false;             // reference and converter, from an earlier conversion
    uint32_t warm_reference = ~0u;
    Event converted = Event::of<&Adc::on_converted>(this);

    double reference(uint32_t control) const {
        switch (field(control, SINGLECTRL_REF)) {
        case V1_25: return 1.25;
        case V2_5: return 2.5;
        case SUPPLY: return part.volts(analog::VDD);
        case V5_DIFF: return 5.0;
        case EXTERNAL: return part.volts(analog::ADC0_REFERENCE);
        case EXTERNAL_TWICE: return 2 * part.volts(analog::ADC0_REFERENCE);
        default: return 2 * part.volts(analog::VDD);
        }
    }

    double input_volts(uint32_t selected, bool difference, double reference) const {
        const int pair = 2 * (int)selected;
        if (difference)
            return selected < 4 ? part.volts(pair) - part.volts(pair + 1) : 0;
        if (selected < TEMPERATURE) return part.volts(analog::ADC0_CH0 + (int)selected);
        switch (selected) {
        case TEMPERATURE: {
            uint32_t degrees = 0, reading = 0;
            part.peek(CALIBRATED_AT, 1, degrees);
            part.peek(CALIBRATED_READING, 2, reading);
            const double code =
                (reading >> 4) + (part.volts(analog::TEMPERATURE) - degrees) * CODES_PER_DEGREE;
            return (code + 0.5) * 1.25 / 4096;
        }
        case VDD_THIRD: return part.volts(analog::VDD) / 3;
        case VDD: return part.volts(analog::VDD);
        case REFERENCE_HALF: return reference / 2;
        case DAC0: return part.dac->internal_volts(0);
        case DAC1: return part.dac->internal_volts(1);
        default: return 0;
        }
    }

    uint32_t result(uint32_t control, uint32_t selected) const {
        const bool difference = control & SINGLECTRL_DIFF;
        const double full = reference(control);
        const double fraction = full > 0 ? input_volts(selected, difference, full) / full : 0;
        const uint32_t resolution = field(control, SINGLECTRL_RES);
        int bits = BITS[resolution];
        if (resolution == OVERSAMPLED)  // each doubling adds a bit, up to 16 (28.3.7.4)
            bits = std::min(16, 13 + (int)field(reg(CTRL), CTRL_OVSRSEL));
        const double scale = std::ldexp(1.0, difference ? bits - 1 : bits);
        const double lowest = difference ? -scale : 0;
        const double clipped = std::min(std::max(std::floor(fraction * scale), lowest), scale - 1);
        const int32_t code = std::isnan(clipped) ? 0 : (int32_t)clipped;
        return control & SINGLECTRL_ADJ ? (uint32_t)code << (16 - bits) : (uint32_t)code;
    }

    // Reference and converter warm up in units of TIMEBASE, a microsecond (28.3.4).
    int64_t warm_up(uint32_t control) {
        const uint32_t chosen = field(control, SINGLECTRL_REF);
        const uint32_t mode = field(reg(CTRL), CTRL_WARMUPMODE);
        if (mode == KEEP_WARM && warm && warm_reference == chosen) return 0;
        const bool bandgap = chosen == V1_25 || chosen == V2_5 || chosen == V5_DIFF;
        const int64_t units = 1 + (bandgap && mode != FAST_BANDGAP ? 4 : 0);
        return units * (1 + (int64_t)field(reg(CTRL), CTRL_TIMEBASE));
    }

    // In ADC clocks: acquisition, one per bit, and one more; times the oversampling (28.3.3).
    int64_t cycles(uint32_t control) const {
        const uint32_t resolution = field(control, SINGLECTRL_RES);
        const int64_t acquired = (int64_t)1 << std::min(field(control, SINGLECTRL_AT), 8u);
        int64_t times = 1;
        if (resolution == OVERSAMPLED)
            times = (int64_t)2 << std::min(field(reg(CTRL), CTRL_OVSRSEL), 11u);
        return (acquired + BITS[resolution] + 1) * times;
    }

    // Starts the next conversion; single conversions have priority.
    void begin() {
        const Rate rate = clock_now();
        if (converting || !rate.runs() || !(single_wanted || scanning)) return;
        single_running = single_wanted;
        if (!single_running)
            scan_channel = __builtin_ctz(to_scan);
        const uint32_t control = reg(single_running ? SINGLECTRL : SCANCTRL);
        const int64_t length = warm_up(control) +
                               cycles(control) * (1 + (int64_t)field(reg(CTRL), CTRL_PRESC));
        warm_reference = field(control, SINGLECTRL_REF);
        warm = true;
        converting = true;
        part.schedule_after(converted, rate.span(length));
    }

    void start_scan() {
        scanning = true;
        to_scan = field(reg(SCANCTRL), SCANCTRL_INPUTMASK);
        if (reg(SCANCTRL) & SCANCTRL_DIFF)
            to_scan &= 0xF;
        scanning = to_scan != 0;
    }

    void on_converted(int64_t) {
        if (!clock_now().runs()) {
            stalled = true;
            return;
        }
        converting = false;
        uint32_t &status = reg(STATUS);
        if (single_running) {
            if (single_wanted) {
                const uint32_t control = reg(SINGLECTRL);
                reg(SINGLEDATA) = result(control, field(control, SINGLECTRL_INPUTSEL));
                reg(IF) |= IF_SINGLE | (status & STATUS_SINGLEDV ? IF_SINGLEOF : 0);
                status |= STATUS_SINGLEDV;
                single_wanted = control & SINGLECTRL_REP;
                part.prs->pulse(REFLEX, 0);
            }
        } else if (scanning) {
            reg(SCANDATA) = result(reg(SCANCTRL), (uint32_t)scan_channel);
            reg(IF) |= IF_SCAN | (status & STATUS_SCANDV ? IF_SCANOF : 0);
            status = (status & ~STATUS_SCANDATASRC) | STATUS_SCANDV |
                     to_field((uint32_t)scan_channel, STATUS_SCANDATASRC);
            to_scan &= to_scan - 1;
            scanning = to_scan != 0;
            if (!scanning) {
                part.prs->pulse(REFLEX, 1);
                if (reg(SCANCTRL) & SCANCTRL_REP)
                    start_scan();
            }
        }
        follow();
        begin();
        follow();
    }

    void follow() {
        const bool kept = field(reg(CTRL), CTRL_WARMUPMODE) == KEEP_WARM && warm;
        const bool ready = converting || kept;
        uint32_t &status = reg(STATUS);
        status &= STATUS_SINGLEDV | STATUS_SCANDV | STATUS_SCANDATASRC;
        status |= (single_wanted ? STATUS_SINGLEACT : 0) | (scanning ? STATUS_SCANACT : 0) |
                  (ready ? STATUS_WARM : 0) | (ready && single_running ? STATUS_SINGLEREFWARM : 0) |
                  (ready && !single_running ? STATUS_SCANREFWARM : 0);
        part.dma->request(SOURCE, 0, status & STATUS_SINGLEDV);
        part.dma->request(SOURCE, 1, status & STATUS_SCANDV);
        update_interrupts();
    }
};

}  // namespace

void add_adc(Part &part) { part.add(new Adc(part, instance::ADC0)); }

}  // namespace efm32gg
