#include "timer.h"

#include "dma.h"
#include "gpio.h"
#include "prs.h"

#include <algorithm>

namespace efm32gg {

using namespace timer;

namespace {

enum Mode : uint32_t { UP, DOWN, UP_DOWN, QUADRATURE };
enum ChannelMode : uint32_t { OFF, CAPTURE, COMPARE, PWM };
enum Source : uint32_t { PRESCALED, CHANNEL_1, CASCADE };
enum Action : uint32_t { NONE, TOGGLE, CLEAR, SET };           // of outputs
enum InputAction : uint32_t { NOTHING, START, STOP, RELOAD };  // of CC0's edges
constexpr uint32_t LAST = 0xFFFF;
constexpr uint32_t UNLOCK = 0xCE80;

}  // namespace

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

// -- registers --

uint32_t Timer::status() const {
    uint32_t bits = (running ? STATUS_RUNNING : 0) | (current().down ? STATUS_DIR : 0) |
                    (buffered_top ? STATUS_TOPBV : 0);
    for (int n = 0; n < CHANNELS; n++)
        bits |= (buffered[n] ? STATUS_CCVBV0 << n : 0) | (captured[n] ? STATUS_ICV0 << n : 0) |
                (captured[n] > 1 ? STATUS_CCVBV0 << n : 0) |
                (outputs[n] ? STATUS_CCPOL0 << n : 0);
    return bits;
}

uint32_t Timer::peek(uint32_t offset) const {
    switch (offset) {
    case CNT:
        return current().value;
    case STATUS:
        return status();
    case CC0_CCVP:
    case CC1_CCVP:
    case CC2_CCVP:
        return reg(offset - 4);
    }
    return Peripheral::peek(offset);
}

uint32_t Timer::read(uint32_t offset) {
    if (pending_ticks()) {
        fold();
        plan();
    }
    const uint32_t value = peek(offset);
    for (int n = 0; n < CHANNELS; n++)
        if (offset == cc(n, CC0_CCV) && cc_mode(n) == CAPTURE && captured[n]) {
            captured[n]--;
            reg(cc(n, CC0_CCV)) = reg(cc(n, CC0_CCVB));
        }
    return value;
}

void Timer::write(uint32_t offset, uint32_t value) {
    fold();
    switch (offset) {
    case CMD:
        if (value & CMD_STOP) {
            stop();
        } else if (value & CMD_START) {
            start();
            if (timers && reg(CTRL) & CTRL_SYNC)
                for (int n = 0; n < 4; n++)
                    if (timers[n] != this && timers[n]->reg(CTRL) & CTRL_SYNC) {
                        timers[n]->start();
                        timers[n]->plan();
                    }
        }
        break;
    case CNT:
        count.value = value & LAST;
        break;
    case CTRL: {
        const uint32_t before = reg(CTRL);
        store(offset, value);
        if ((before ^ reg(CTRL)) & (CTRL_PRESC | CTRL_CLKSEL))
            restart_clock();
        if (mode() == QUADRATURE)
            part.log_once("%s: quadrature decoding is not modelled", instance.name);
        if ((before ^ reg(CTRL)) & CTRL_MODE)
            count.down = mode() == DOWN;
        break;
    }
    case TOPB:
        store(offset, value);
        buffered_top = true;
        break;
    case TOP:
        store(offset, value);
        buffered_top = false;
        break;
    case DTLOCK:
        reg(DTLOCK) = (value & DTLOCK_LOCKKEY) != UNLOCK;
        break;
    default:
        Peripheral::write(offset, value);
        for (int n = 0; n < CHANNELS; n++) {
            if (offset == cc(n, CC0_CCVB))
                buffered[n] = compares(n);
            if (offset == cc(n, CC0_CCV))
                buffered[n] = false;
            if (offset == cc(n, CC0_CTRL)) {
                captured[n] = 0;
                outputs[n] = cc_mode(n) == COMPARE && value & CC0_CTRL_COIST;
                inputs[n] = value & CC0_CTRL_INSEL ? part.prs->level((int)take(value, CC0_CTRL_PRSSEL))
                                                   : part.gpio->input(pin(n));
            }
        }
        if (offset == ROUTE)
            for (int n = 0; n < CHANNELS; n++)
                for (int location = 0; location < LOCATIONS; location++)
                    part.gpio->function(ROUTES[signals + n][location], this, false, false);
    }
    const uint32_t starts = CTRL_RISEA | CTRL_FALLA;
    if (!listening && ((offset == CTRL && (value & starts || take(value, CTRL_CLKSEL))) ||
                       cc_mode(0) == CAPTURE || cc_mode(1) == CAPTURE || cc_mode(2) == CAPTURE)) {
        part.gpio->listen(*this);
        listening = true;
    }
    show_outputs();
    plan();
}

// -- outputs --

int Timer::pin(int n) const {
    const uint32_t location = take(reg(ROUTE), ROUTE_LOCATION);
    return reg(ROUTE) & ROUTE_CC0PEN << n && location < LOCATIONS ? ROUTES[signals + n][location] : -1;
}

void Timer::act(int n, uint32_t action) {
    if (action == TOGGLE)
        outputs[n] = !outputs[n];
    else if (action != NONE)
        outputs[n] = action == SET;
}

void Timer::show_outputs() {
    for (int n = 0; n < CHANNELS; n++) {
        if (!compares(n))
            continue;
        if (cc_mode(n) == PWM)
            outputs[n] = running && count.value < reg(cc(n, CC0_CCV));
        const int to = pin(n);
        if (to >= 0)
            part.gpio->function(to, this, true,
                                outputs[n] != !!(reg(cc(n, CC0_CTRL)) & CC0_CTRL_OUTINV));
    }
}

// -- inputs --

void Timer::pin_changed(int port, int bit, bool level) {
    const int changed = port * 16 + bit;
    for (int n = 0; n < CHANNELS; n++)
        if (pin(n) == changed && !(reg(cc(n, CC0_CTRL)) & CC0_CTRL_INSEL) && !compares(n) &&
            inputs[n] != level)
            edge(n, level);
}

void Timer::prs_changed(int channel, bool level) {
    for (int n = 0; n < CHANNELS; n++) {
        const uint32_t control = reg(cc(n, CC0_CTRL));
        if (control & CC0_CTRL_INSEL && (int)take(control, CC0_CTRL_PRSSEL) == channel &&
            inputs[n] != level)
            edge(n, level);
    }
}

void Timer::edge(int n, bool rising) {
    inputs[n] = rising;
    if (!part.unit_rate(instance).runs() || within_edge)
        return;
    within_edge = true;
    fold();
    const uint32_t control = reg(cc(n, CC0_CTRL)), which = take(control, CC0_CTRL_ICEDGE);
    const bool wanted = which == 2 || (which == 0 && rising) || (which == 1 && !rising);
    if (n == 0) {
        const uint32_t action = take(reg(CTRL), rising ? CTRL_RISEA : CTRL_FALLA);
        if (action == RELOAD)
            count.value = mode() == DOWN ? reg(TOP) : 0;
        if (action == START || action == RELOAD)
            start();
        if (action == STOP)
            stop();
    }
    if (n == 1 && running && wanted && take(reg(CTRL), CTRL_CLKSEL) == CHANNEL_1)
        pass(1);
    if (wanted && cc_mode(n) == CAPTURE)
        capture(n);
    plan();
    within_edge = false;
}

// CCV has the oldest capture, CCVB the one after it (20.3.2.2).
void Timer::capture(int n) {
    if (captured[n] == 0)
        reg(cc(n, CC0_CCV)) = count.value;
    reg(cc(n, CC0_CCVB)) = count.value;
    if (captured[n] == 2)
        reg(IF) |= IF_ICBOF0 << n;
    else
        captured[n]++;
    const uint32_t events = take(reg(cc(n, CC0_CTRL)), CC0_CTRL_ICEVCTRL);
    skipped[n] = !skipped[n];
    const bool told = events == 0 || (events == 1 && !skipped[n]) || (events == 2 && inputs[n]) ||
                      (events == 3 && !inputs[n]);
    if (!told)
        return;
    reg(IF) |= IF_CC0 << n;
    part.prs->pulse(reflex, 2 + n);
    part.dma->pulse(source, 1 + n);
    update_interrupts();
}

}  // namespace efm32gg
