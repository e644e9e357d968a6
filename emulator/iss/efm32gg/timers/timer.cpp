#include "efm32gg/timers/timer.h"

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"

#include <algorithm>

namespace efm32gg {

using namespace timer;

void Timer::reset() {
    Peripheral::reset();
    part.cancel(due);
    running = buffered_top = false;
    count = {};
    ticks = Rate();
    counted = 0;
    for (int n = 0; n < CHANNELS; n++) {
        buffered[n] = outputs[n] = skipped[n] = inputs[n] = false;
        captured[n] = 0;
        part.gpio->release(signals + n, this);
    }
}

// Ticks until the next overflow or underflow, at least 1. Counting up and down turns at the top
// and at 0: the tick after it is the overflow or underflow.
int64_t Timer::until_wrap(const Count &from) const {
    const int64_t top = reg(TOP), value = from.value;
    if (counts_down(from)) return value + 1;
    return (value > top ? LAST : top) - value + 1;
}

// Ticks until the counter reaches `value` before the next wrap; FAR if it does not.
int64_t Timer::until_value(const Count &from, uint32_t value) const {
    const int64_t distance = counts_down(from) ? (int64_t)from.value - value
                                               : (int64_t)value - from.value;
    return distance > 0 && distance < until_wrap(from) ? distance : FAR;
}

// Ticks until channel n matches: the edge at which the counter leaves the compare value, the wrap
// at the latest; FAR if it does not (the rule is in low_energy.h).
int64_t Timer::until_match(const Count &from, int n) const {
    const uint32_t value = reg(cc(n, CC0_CCV));
    if (from.value == value) return 1;
    const int64_t reached = until_value(from, value);
    return reached == FAR ? FAR : reached + 1;
}

// Ticks until the pin of a PWM channel changes: it follows the counter's value.
int64_t Timer::until_level(const Count &from, int n) const {
    return cc_mode(n) == PWM && pin(n) >= 0 ? until_value(from, reg(cc(n, CC0_CCV))) : FAR;
}

// `steps` may reach the next wrap, but not pass it.
Timer::Count Timer::after(Count from, int64_t steps) const {
    const bool down = counts_down(from);
    if (steps < until_wrap(from))
        return {(uint32_t)(down ? from.value - steps : from.value + steps), down};
    const uint32_t top = reg(TOP);
    switch (mode()) {
    case DOWN: return {top, true};
    case UP_DOWN:
        return down ? Count{std::min(1u, top), false} : Count{top ? top - 1 : 0, true};
    default: return {0, false};
    }
}

int64_t Timer::pending_ticks() const {
    if (!running || !ticks.runs() || field(reg(CTRL), CTRL_CLKSEL) != PRESCALED) return 0;
    return ticks.edges(part.now()) - counted;
}

// Any number of steps; whole turns after the next wrap change nothing.
Timer::Count Timer::far_after(Count from, int64_t steps) const {
    const int64_t first = until_wrap(from);
    if (steps >= first) {
        from = after(from, first);
        const int64_t top = reg(TOP);
        steps = (steps - first) % (mode() == UP_DOWN ? 2 * std::max<int64_t>(1, top) : top + 1);
    }
    while (steps > 0) {
        const int64_t part_way = std::min(steps, until_wrap(from));
        from = after(from, part_way);
        steps -= part_way;
    }
    return from;
}

// Updates the counter and its flags to now.
void Timer::fold() {
    const int64_t steps = pending_ticks();
    counted += steps;
    pass(steps);
}

void Timer::pass(int64_t steps) {
    while (steps > 0 && running) {
        // Without effects, several whole turns set the same flags as two.
        const int64_t turn = until_wrap(count) + 2 * ((int64_t)reg(TOP) + 1);
        if (steps > 4 * turn && !watched_wrap()) {
            count = far_after(count, steps - 2 * turn);
            steps = 2 * turn;
        }
        int64_t next = std::min(steps, until_wrap(count));
        for (int n = 0; n < CHANNELS; n++)
            if (compares(n))
                next = std::min({next, until_match(count, n), until_level(count, n)});
        const bool wraps = next == until_wrap(count);
        bool matches[CHANNELS];
        for (int n = 0; n < CHANNELS; n++)
            matches[n] = compares(n) && until_match(count, n) == next;
        count = after(count, next);
        steps -= next;
        if (wraps)
            wrapped();
        for (int n = 0; n < CHANNELS; n++)
            if (matches[n])
                matched(n);
        show_outputs();
    }
}

// An overflow or underflow has just happened.
void Timer::wrapped() {
    const bool under = mode() == DOWN || (mode() == UP_DOWN && !count.down);
    reg(IF) |= under ? IF_UF : IF_OF;
    part.prs->pulse(reflex, under ? 0 : 1);
    part.dma->pulse(source, 0);
    const bool loads = mode() != UP_DOWN || under;
    if (loads && buffered_top) {
        reg(TOP) = reg(TOPB);
        buffered_top = false;
        if (mode() == DOWN)
            count.value = reg(TOP);
    }
    for (int n = 0; n < CHANNELS; n++) {
        if (compares(n) && loads && buffered[n]) {
            reg(cc(n, CC0_CCV)) = reg(cc(n, CC0_CCVB));
            buffered[n] = false;
        }
        if (cc_mode(n) == COMPARE)
            act(n, field(reg(cc(n, CC0_CTRL)), under ? CC0_CTRL_CUFOA : CC0_CTRL_COFOA));
    }
    if (reg(CTRL) & CTRL_OSMEN)
        stop();
    update_interrupts();
    if (Timer *next = next_timer())
        next->step();
}

// The timer that this one can clock; null for the last one.
Timer *Timer::next_timer() const {
    const size_t next = (size_t)instance.index + 1;
    return next < part.timers.size() ? part.timers[next] : nullptr;
}

void Timer::matched(int n) {
    reg(IF) |= IF_CC0 << n;
    part.prs->pulse(reflex, 2 + n);
    part.dma->pulse(source, 1 + n);
    if (cc_mode(n) == COMPARE)
        act(n, field(reg(cc(n, CC0_CTRL)), CC0_CTRL_CMOA));
    update_interrupts();
}

bool Timer::watched_wrap() const {
    const Timer *next = next_timer();
    const bool cascade =
        next && next->running && field(next->reg(CTRL), CTRL_CLKSEL) == CASCADE;
    if (cascade || buffered_top || reg(CTRL) & CTRL_OSMEN || part.dma->listens(source, 0) ||
        part.prs->listens(reflex, 0) || part.prs->listens(reflex, 1))
        return true;
    if (reg(IEN) & (IEN_OF | IEN_UF) & ~reg(IF)) return true;
    for (int n = 0; n < CHANNELS; n++)
        if (compares(n) && (buffered[n] || pin(n) >= 0)) return true;
    return false;
}

bool Timer::watched(int n) const {
    return compares(n) &&
           (pin(n) >= 0 || reg(IEN) & ~reg(IF) & IEN_CC0 << n || part.dma->listens(source, 1 + n) ||
            part.prs->listens(reflex, 2 + n));
}

void Timer::plan() {
    part.cancel(due);
    if (!running || !ticks.runs() || field(reg(CTRL), CTRL_CLKSEL) != PRESCALED) return;
    const int64_t wrap = until_wrap(count);
    int64_t next = watched_wrap() ? wrap : FAR;
    for (int n = 0; n < CHANNELS; n++)
        if (watched(n)) {
            const int64_t distance = std::min(until_match(count, n), until_level(count, n));
            // Beyond the next wrap: plan again there.
            next = std::min(next, distance == FAR ? wrap : distance);
        }
    if (next != FAR)
        part.schedule(due, ticks.time(counted + next));
}

void Timer::on_due(int64_t) {
    fold();
    plan();
}

// -- clock, start and stop --

Rate Timer::prescaled(const Rate &rate, int64_t origin) const {
    return rate.divided((int64_t)1 << std::min(field(reg(CTRL), CTRL_PRESC), 10u), origin);
}

// Restarts the prescaler.
void Timer::restart_clock() {
    const Rate rate = clock_now();
    counted = 0;
    ticks = Rate();
    if (rate.runs())
        ticks = prescaled(rate, rate.time(rate.edge_at_or_after(part.now())));
}

void Timer::clocks_changed() {
    const Rate rate = clock_now();
    const Rate wanted = rate.runs() ? prescaled(rate, 0) : Rate();
    if (ticks.runs() != wanted.runs() || !ticks.same_frequency(wanted))
        restart_clock();
    plan();
}

void Timer::start() {
    if (running) return;
    running = true;
    restart_clock();
    count.down = mode() == DOWN || (mode() == UP_DOWN && count.down);
}

// Counts one overflow of the timer below it.
void Timer::step() {
    if (running && field(reg(CTRL), CTRL_CLKSEL) == CASCADE)
        pass(1);
}

}  // namespace efm32gg
