#include "efm32gg/timers/timer.h"

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"

#include <algorithm>

namespace efm32gg {

using namespace timer;

Timer::Timer(Part &part, const Instance &instance, int source, int reflex, int signals)
    : Peripheral(part, instance), source(source), reflex(reflex), signals(signals) {}

void Timer::connect(Timer *const (&all)[4]) { timers = all; }

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
        if (part.gpio)
            for (int location = 0; location < LOCATIONS; location++)
                part.gpio->function(ROUTES[signals + n][location], this, false, false);
    }
}

// -- the counter as arithmetic --

// Ticks until the next overflow or underflow, at least 1. Counting up and down turns at the top
// and at 0: the tick after it is the overflow or underflow.
int64_t Timer::until_wrap(const Count &from) const {
    const int64_t top = reg(TOP), value = from.value;
    if (mode() == DOWN || (mode() == UP_DOWN && from.down))
        return value + 1;
    return (value > top ? LAST : top) - value + 1;
}

// Ticks until the counter has `value`, within the way to the next wrap; FAR when not there.
int64_t Timer::until_value(const Count &from, uint32_t value) const {
    const bool down = mode() == DOWN || (mode() == UP_DOWN && from.down);
    const int64_t way = down ? (int64_t)from.value - value : (int64_t)value - from.value;
    return way > 0 && way < until_wrap(from) ? way : FAR;
}

// `steps` is not beyond the next wrap.
Timer::Count Timer::after(Count from, int64_t steps) const {
    const bool down = mode() == DOWN || (mode() == UP_DOWN && from.down);
    if (steps < until_wrap(from))
        return {(uint32_t)(down ? from.value - steps : from.value + steps), down};
    const uint32_t top = reg(TOP);
    switch (mode()) {
    case DOWN:
        return {top, true};
    case UP_DOWN:
        return down ? Count{std::min(1u, top), false} : Count{top ? top - 1 : 0, true};
    default:
        return {0, false};
    }
}

int64_t Timer::pending_ticks() const {
    if (!running || !ticks.runs() || take(reg(CTRL), CTRL_CLKSEL) != PRESCALED)
        return 0;
    return ticks.edges(part.now()) - counted;
}

Timer::Count Timer::current() const {
    Count now = count;
    int64_t steps = pending_ticks();
    if (steps > 0 && !(reg(CTRL) & CTRL_OSMEN)) {  // whole turns change nothing
        const int64_t first = until_wrap(now);
        if (steps >= first) {
            now = after(now, first);
            steps -= first;
            const int64_t period = mode() == UP_DOWN ? 2 * (int64_t)std::max(1u, reg(TOP))
                                                     : (int64_t)reg(TOP) + 1;
            steps %= period;
        }
    }
    while (steps > 0) {
        const int64_t part_way = std::min(steps, until_wrap(now));
        now = after(now, part_way);
        steps -= part_way;
    }
    return now;
}

// -- time passes --

// Brings the counter and its flags up to now.
void Timer::fold() {
    const int64_t steps = pending_ticks();
    counted += steps;
    pass(steps);
}

void Timer::pass(int64_t steps) {
    while (steps > 0 && running) {
        // Nobody waits for what comes next: flags after several whole turns are those after two.
        const int64_t turn = until_wrap(count) + 2 * ((int64_t)reg(TOP) + 1);
        if (steps > 4 * turn && !watched_wrap()) {
            skip(steps - 2 * turn);
            steps = 2 * turn;
        }
        int64_t next = std::min(steps, until_wrap(count));
        for (int n = 0; n < CHANNELS; n++)
            if (compares(n))
                next = std::min(next, until_value(count, reg(cc(n, CC0_CCV))));
        const bool wraps = next == until_wrap(count);
        const Count before = count;
        count = after(count, next);
        steps -= next;
        if (wraps)
            wrapped();
        for (int n = 0; n < CHANNELS; n++)
            if (compares(n) && count.value == reg(cc(n, CC0_CCV)) &&
                (wraps || count.value != before.value))
                matched(n);
        show_outputs();
    }
}

void Timer::skip(int64_t steps) {
    const int64_t first = until_wrap(count);
    if (steps < first)
        return (void)(count = after(count, steps));
    count = after(count, first);
    const int64_t period =
        mode() == UP_DOWN ? 2 * (int64_t)std::max(1u, reg(TOP)) : (int64_t)reg(TOP) + 1;
    steps = (steps - first) % period;
    while (steps > 0) {
        const int64_t part_way = std::min(steps, until_wrap(count));
        count = after(count, part_way);
        steps -= part_way;
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
            act(n, take(reg(cc(n, CC0_CTRL)), under ? CC0_CTRL_CUFOA : CC0_CTRL_COFOA));
    }
    if (reg(CTRL) & CTRL_OSMEN)
        stop();
    update_interrupts();
    if (timers)
        for (int n = 0; n < 3; n++)
            if (timers[n] == this)
                timers[n + 1]->step();
}

void Timer::matched(int n) {
    reg(IF) |= IF_CC0 << n;
    part.prs->pulse(reflex, 2 + n);
    part.dma->pulse(source, 1 + n);
    if (cc_mode(n) == COMPARE)
        act(n, take(reg(cc(n, CC0_CTRL)), CC0_CTRL_CMOA));
    update_interrupts();
}

// -- what somebody waits for --

bool Timer::watched_wrap() const {
    const bool cascade = timers && [this] {
        for (int n = 0; n < 3; n++)
            if (timers[n] == this)
                return timers[n + 1]->running &&
                       take(timers[n + 1]->reg(CTRL), CTRL_CLKSEL) == CASCADE;
        return false;
    }();
    if (cascade || buffered_top || reg(CTRL) & CTRL_OSMEN || part.dma->listens(source, 0) ||
        part.prs->listens(reflex, 0) || part.prs->listens(reflex, 1))
        return true;
    if (reg(IEN) & (IEN_OF | IEN_UF) & ~reg(IF))
        return true;
    for (int n = 0; n < CHANNELS; n++)
        if (compares(n) && (buffered[n] || pin(n) >= 0))
            return true;
    return false;
}

bool Timer::watched(int n) const {
    return compares(n) &&
           (pin(n) >= 0 || reg(IEN) & ~reg(IF) & IEN_CC0 << n || part.dma->listens(source, 1 + n) ||
            part.prs->listens(reflex, 2 + n));
}

void Timer::plan() {
    part.cancel(due);
    if (!running || !ticks.runs() || take(reg(CTRL), CTRL_CLKSEL) != PRESCALED)
        return;
    const int64_t wrap = until_wrap(count);
    int64_t next = watched_wrap() ? wrap : FAR;
    for (int n = 0; n < CHANNELS; n++)
        if (watched(n)) {
            const uint32_t value = reg(cc(n, CC0_CCV));
            const int64_t way = until_value(count, value);
            // Behind the next wrap: look again there.
            next = std::min(next, way == FAR ? wrap : way);
        }
    if (next != FAR)
        part.schedule(due, ticks.time(counted + next));
}

void Timer::on_due(int64_t) {
    fold();
    plan();
}

// -- clock, start and stop --

// The prescaler begins anew.
void Timer::restart_clock() {
    const Rate rate = part.unit_rate(instance);
    counted = 0;
    ticks = Rate();
    if (rate.runs()) {
        const int64_t origin = rate.time(rate.edge_at_or_after(part.now()));
        ticks = rate.divided((int64_t)1 << std::min(take(reg(CTRL), CTRL_PRESC), 10u), origin);
    }
}

void Timer::clocks_changing() { fold(); }

void Timer::clocks_changed() {
    const Rate rate = part.unit_rate(instance);
    const Rate wanted = rate.runs()
        ? rate.divided((int64_t)1 << std::min(take(reg(CTRL), CTRL_PRESC), 10u), 0) : Rate();
    if (ticks.runs() != wanted.runs() || !ticks.same_frequency(wanted))
        restart_clock();
    plan();
}

void Timer::start() {
    if (running)
        return;
    running = true;
    restart_clock();
    count.down = mode() == DOWN || (mode() == UP_DOWN && count.down);
}

void Timer::stop() { running = false; }

// One count by a cascade or by CC1's edge.
void Timer::step() {
    const uint32_t selected = take(reg(CTRL), CTRL_CLKSEL);
    if (running && selected == CASCADE)
        pass(1);
}

}  // namespace efm32gg
