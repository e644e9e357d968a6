// TIMER. EFM32GG Reference Manual, chapter 20.
//
// The counter is computed when it is accessed. Events are scheduled only for ticks with an effect:
// on an interrupt, a pin, DMA, PRS, a cascaded timer, a buffered value.
// Not modelled: quadrature decoding, dead time insertion, input filters.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Timer : public Peripheral {
public:
    // `source`: of its DMA requests; `reflex`: of its PRS signals; `signals`: of its CC0 pin.
    Timer(Part &part, const Instance &instance, int source, int reflex, int signals)
        : Peripheral(part, instance), source(source), reflex(reflex), signals(signals) {}

    void reset() override;
    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changing() override { fold(); }
    void clocks_changed() override;
    void pin_changed(int port, int bit, bool level) override;
    void prs_changed(int channel, bool level) override;

private:
    static constexpr int CHANNELS = 3;
    enum Mode : uint32_t { UP, DOWN, UP_DOWN, QUADRATURE };
    enum ChannelMode : uint32_t { OFF, CAPTURE, COMPARE, PWM };
    enum ClockSource : uint32_t { PRESCALED, CHANNEL_1, CASCADE };
    enum Action : uint32_t { NONE, TOGGLE, CLEAR, SET };           // of outputs
    enum InputAction : uint32_t { NOTHING, START, STOP, RELOAD };  // of CC0's edges
    static constexpr uint32_t LAST = 0xFFFF;
    static constexpr uint32_t UNLOCK = 0xCE80;
    static constexpr int64_t FAR = INT64_MAX;

    struct Count {
        uint32_t value;
        bool down;
    };

    const int source, reflex, signals;
    Rate ticks;               // the prescaled clock, edge 0 at the start
    int64_t counted = 0;      // edges of `ticks` that `count` includes
    Count count = {};
    bool listening = false;   // to pins
    bool within_edge = false; // the effect of an edge may cause another edge
    bool running = false, buffered_top = false, inputs[CHANNELS] = {};
    bool buffered[CHANNELS] = {}, outputs[CHANNELS] = {}, skipped[CHANNELS] = {};
    int captured[CHANNELS] = {};
    Event due = Event::of<&Timer::on_due>(this);

    uint32_t cc(int n, uint32_t offset) const { return offset + 0x10 * (uint32_t)n; }
    uint32_t cc_mode(int n) const {
        return field(reg(cc(n, timer::CC0_CTRL)), timer::CC0_CTRL_MODE);
    }
    uint32_t mode() const { return field(reg(timer::CTRL), timer::CTRL_MODE); }
    bool compares(int n) const { return cc_mode(n) >= COMPARE; }
    bool counts_down(const Count &from) const {
        return mode() == DOWN || (mode() == UP_DOWN && from.down);
    }
    Rate prescaled(const Rate &rate, int64_t origin) const;
    Timer *next_timer() const;
    int64_t until_wrap(const Count &from) const;
    int64_t until_value(const Count &from, uint32_t value) const;
    int64_t until_match(const Count &from, int n) const;
    int64_t until_level(const Count &from, int n) const;
    Count after(Count from, int64_t steps) const;
    Count far_after(Count from, int64_t steps) const;
    Count current() const { return far_after(count, pending_ticks()); }
    int64_t pending_ticks() const;
    void fold();
    void pass(int64_t steps);
    void wrapped();
    void matched(int n);
    bool watched(int n) const;
    bool watched_wrap() const;
    void plan();
    void on_due(int64_t time);
    void restart_clock();
    void start();
    void stop() { running = false; }
    void step();
    void edge(int n, bool rising);
    void capture(int n);
    int pin(int n) const;
    void act(int n, uint32_t action);
    void show_outputs();
    uint32_t status() const;
};

}  // namespace efm32gg
