// LESENSE's sequencer: when what is measured.
#include "efm32gg/analog/lesense.h"

#include "efm32gg/clocks/cmu.h"
#include "efm32gg/pins/gpio.h"

#include <algorithm>

namespace efm32gg {

using namespace lesense;

namespace {

enum ScanMode : uint32_t { PERIODIC, ONE_SHOT, BY_PRS };
enum Mapping : uint32_t { DIRECT, INVERSE, TOGGLE, BY_DECODER };
enum ComparatorMode : uint32_t { UNCONTROLLED, INPUT, INPUT_AND_THRESHOLD };

}  // namespace

void Lesense::reset() {
    LowEnergy::reset();
    part.cancel(due);
    part.cancel(step);
    running = scanning = stopping = counting = level = false;
    to_scan = channel = configuration = edges = sensors = sensor_count = 0;
    previous_state = decoded = 0;
    results.clear();
    clock = Rate();
    follow();
}

uint32_t Lesense::peek(uint32_t offset) const {
    switch (offset) {
    case STATUS:
        return (results.size() ? STATUS_BUFDATAV : 0u) |
               (results.size() >= ResultBuffer::ENTRIES / 2 ? STATUS_BUFHALFFULL : 0u) |
               (results.full() ? STATUS_BUFFULL : 0u) | (running ? STATUS_RUNNING : 0u) |
               (scanning ? STATUS_SCANACTIVE : 0u);
    case PTR:
        return to_field(results.read_index(), PTR_RD) | to_field(results.write_index(), PTR_WR);
    case BUFDATA: return reg(BUF0_DATA + 4 * results.read_index());
    case CURCH: return channel;
    }
    return LowEnergy::peek(offset);
}

uint32_t Lesense::read(uint32_t offset) {
    const uint32_t value = peek(offset);
    if (offset == BUFDATA) {
        results.pop();
        follow();
    }
    return value;
}

void Lesense::write(uint32_t offset, uint32_t value) {
    LowEnergy::write(offset, value);
    if (offset == CTRL && value & CTRL_DUALSAMPLE)
        part.log_once("LESENSE: sampling with both comparators at once is not modelled");
}

void Lesense::apply(uint32_t offset, uint32_t value) {
    if (offset == CMD) return command(value);
    LowEnergy::apply(offset, value);
    if (offset == IDLECONF || offset == ALTEXCONF || offset == ROUTE)
        idle_pins();
    if (offset == POWERDOWN && value & POWERDOWN_RAM)
        for (uint32_t at = ST0_TCONFA; at <= CH15_EVAL; at += 4)
            reg(at) = 0;
    follow();
}

void Lesense::command(uint32_t value) {
    if (value & CMD_CLEARBUF)
        results.clear();
    if (value & CMD_STOP) {  // a scan in progress is completed
        running = stopping = scanning;
        part.cancel(due);
    } else if (value & CMD_START) {
        clock = clock_now();
        running = true;
        stopping = false;
        if (field(reg(CTRL), CTRL_SCANMODE) == ONE_SHOT) {
            begin_scan(part.now());
            running = scanning;
        } else if (field(reg(CTRL), CTRL_SCANMODE) == PERIODIC) {
            period_edge = clock.edges(part.now()) + period();
            plan_period();
        }
    }
    if (value & CMD_DECODE)
        decode(decoder_input());
    follow();
}

void Lesense::clocks_changed() {
    LowEnergy::clocks_changed();
    const Rate now = clock_now();
    if (now.runs() == clock.runs() && now.origin == clock.origin && now.same_frequency(clock))
        return;
    clock = now;
    part.cancel(due);
    part.cancel(step);
    if (!running || !clock.runs()) return;
    // Period and channel begin again with the new clock.
    if (field(reg(CTRL), CTRL_SCANMODE) == PERIODIC) {
        period_edge = clock.edges(part.now()) + period();
        plan_period();
    }
    if (scanning)
        begin_channel(part.now());
}

void Lesense::prs_changed(int changed, bool high) {
    const uint32_t control = reg(CTRL);
    if (running && high && field(control, CTRL_SCANMODE) == BY_PRS &&
        (int)field(control, CTRL_PRSSEL) == changed)
        begin_scan(part.now());
}

// -- periods and scans --

// In clocks (25.3.2).
int64_t Lesense::period() const {
    return (1 + (int64_t)field(reg(TIMCTRL), TIMCTRL_PCTOP)) << field(reg(TIMCTRL), TIMCTRL_PCPRESC);
}

void Lesense::plan_period() {
    if (clock.runs())
        part.schedule(due, clock.time(period_edge));
}

void Lesense::on_due(int64_t time) {
    begin_scan(time);
    period_edge += period();
    plan_period();
}

void Lesense::begin_scan(int64_t time) {
    if (scanning) return;
    to_scan = reg(CHEN);
    if (!to_scan) return;
    scanning = true;
    sensors = sensor_count = 0;
    channel = (uint32_t)__builtin_ctz(to_scan);
    if (clock.runs())
        begin_channel(time);
}

// Its own configuration, that eight further, or either by the last result or the decoder's state.
uint32_t Lesense::configuration_of(uint32_t number) const {
    switch (field(reg(CTRL), CTRL_SCANCONF)) {
    case INVERSE: return (number + 8) % CHANNELS;
    case TOGGLE: return reg(SCANRES) >> number & 1 ? (number + 8) % CHANNELS : number;
    case BY_DECODER: return reg(DECSTATE) >= 8 ? (number + 8) % CHANNELS : number;
    default: return number;
    }
}

int64_t Lesense::span(uint32_t cycles, bool high_frequency) const {
    if (!high_frequency)
        return clock.span((int64_t)cycles << field(reg(TIMCTRL), TIMCTRL_LFPRESC));
    const Rate auxiliary(part.cmu->auxiliary_hertz(), 1, 0);
    return auxiliary.span((int64_t)cycles << field(reg(TIMCTRL), TIMCTRL_AUXPRESC));
}

// Lengths are those of CHx_TIMING plus one, but for the measure delay.
void Lesense::begin_channel(int64_t time) {
    configuration = configuration_of(channel);
    const uint32_t timing = configured(CH0_TIMING), interact = configured(CH0_INTERACT);
    const bool fast = interact & CH0_INTERACT_EXCLK, fast_sample = interact & CH0_INTERACT_SAMPLECLK;
    plan.excite = later(time, clock.span((int64_t)field(reg(TIMCTRL), TIMCTRL_STARTDLY)));
    plan.excited = later(plan.excite, span(1 + field(timing, CH0_TIMING_EXTIME), fast));
    plan.measure = later(plan.excite, span(field(timing, CH0_TIMING_MEASUREDLY), fast));
    plan.sample = later(plan.excite, span(1 + field(timing, CH0_TIMING_SAMPLEDLY), fast_sample));
    plan.measure = std::min(plan.measure, plan.sample);
    counting = level = false;
    edges = 0;
    plan_step();
}

void Lesense::plan_step() {
    part.schedule(step, std::min({plan.excite, plan.excited, plan.measure, plan.sample}));
}

void Lesense::on_step(int64_t time) {
    if (plan.excite <= time) {
        plan.excite = NEVER;
        control_dac(true);
        excite(true);
    }
    if (plan.measure <= time) {
        plan.measure = NEVER;
        counting = true;
        level = sense();
    }
    if (plan.sample <= time) {
        plan.sample = NEVER;
        counting = false;
        const bool compares = configured(CH0_INTERACT) & CH0_INTERACT_SAMPLE;
        evaluate(compares ? sense() : edges);
    }
    if (plan.excited <= time) {
        plan.excited = NEVER;
        excite(false);
    }
    if (plan.sample == NEVER && plan.excited == NEVER)
        end_channel(time);
    else
        plan_step();
}

void Lesense::end_channel(int64_t time) {
    to_scan &= ~(1u << channel);
    if (!to_scan) return end_scan();
    channel = (uint32_t)__builtin_ctz(to_scan);
    begin_channel(time);
}

void Lesense::end_scan() {
    scanning = false;
    control_dac(false);
    if (stopping || field(reg(CTRL), CTRL_SCANMODE) == ONE_SHOT)
        running = stopping = false;
    if (reg(CTRL) & CTRL_STRSCANRES)
        store(reg(SCANRES));
    if (sensor_count && !(reg(DECCTRL) & DECCTRL_INPUT))
        reg(SENSORSTATE) = sensors;
    if (sensor_count && !(reg(DECCTRL) & DECCTRL_DISABLE))
        decode(decoder_input());
    raise(IF_SCANCOMPLETE);
    follow();
}

// -- sensors --

// The comparator's output for the channel.
bool Lesense::sense() {
    const int number = (int)channel / 8;
    const uint32_t mode = field(reg(PERCTRL), PERCTRL_ACMP0MODE << 2 * number);
    const uint32_t threshold = field(configured(CH0_INTERACT), CH0_INTERACT_ACMPTHRES) & 0x3F;
    const bool output = part.comparators[number]->sense(
        mode == UNCONTROLLED ? -1 : (int)channel % 8,
        mode == INPUT_AND_THRESHOLD ? (int)threshold : -1, level);
    return output != !!(reg(CTRL) & CTRL_ACMP0INV << number);
}

void Lesense::analog_changed() {
    if (!counting) return;
    const bool before = level;
    level = sense();
    if (level && !before && edges++ == 0xFFFF)
        raise(IF_CNTOF);
}

// Controls the channels of the DAC during a scan, as far as PERCTRL says so.
void Lesense::control_dac(bool on) {
    const uint32_t control = reg(PERCTRL);
    for (int n = 0; n < Dac::CHANNELS; n++) {
        if (!field(control, PERCTRL_DACCH0CONV << 2 * n)) continue;
        const bool own = control & PERCTRL_DACCH0DATA << n;
        const uint32_t code = own ? field(configured(CH0_INTERACT), CH0_INTERACT_ACMPTHRES)
                                  : part.dac->reg(dac::CH0DATA + 4 * (uint32_t)n);
        part.dac->sense(n, code, on ? field(control, PERCTRL_DACCH0OUT << 2 * n) : 0);
    }
}

// -- pins: those of channels and of alternative excitation, in excitation and in between --

void Lesense::drive(int signal, bool enabled, Excitation how) {
    const bool driven = enabled && (how == Excitation::HIGH || how == Excitation::LOW);
    part.gpio->function(ROUTES[signal][0], this, driven, how == Excitation::HIGH);
}

void Lesense::idle_pins() {
    const auto idle = [](uint32_t word, int n) { return (Excitation)(word >> 2 * n & 3); };
    for (int n = 0; n < (int)CHANNELS; n++)
        drive(route::LESENSE_CH0 + n, reg(ROUTE) >> n & 1, idle(reg(IDLECONF), n));
    for (int n = 0; n < 8; n++)
        drive(route::LESENSE_ALTEX0 + n, reg(ROUTE) >> (16 + n) & 1, idle(reg(ALTEXCONF), n));
}

void Lesense::excite(bool on) {
    if (!on) return idle_pins();
    const uint32_t interact = configured(CH0_INTERACT);
    const auto how = (Excitation)field(interact, CH0_INTERACT_EXMODE);
    const bool alternative = interact & CH0_INTERACT_ALTEX;
    const bool at_comparators = reg(CTRL) & CTRL_ALTEXMAP;
    const int own = (int)(alternative ? channel ^ 8 : channel);
    if (!alternative || at_comparators)
        drive(route::LESENSE_CH0 + own, reg(ROUTE) >> own & 1, how);
    for (int n = 0; n < 8; n++) {
        const bool chosen = alternative && !at_comparators && n == (int)channel % 8;
        if (chosen || reg(ALTEXCONF) >> (16 + n) & 1)
            drive(route::LESENSE_ALTEX0 + n, reg(ROUTE) >> (16 + n) & 1, how);
    }
}

void add_lesense(Part &part) { part.add(new Lesense(part, instance::LESENSE)); }

}  // namespace efm32gg
