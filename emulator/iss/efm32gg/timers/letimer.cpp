#include "efm32gg/timers/letimer.h"

#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"

#include <algorithm>

namespace efm32gg {

using namespace letimer;

namespace {

enum Repeat : uint32_t { FREE, ONE_SHOT, BUFFERED, DOUBLE };
enum Action : uint32_t { NOTHING, TOGGLE, PULSE, PWM };
constexpr uint32_t LAST = 0xFFFF;
constexpr int REFLEX = 52;

}  // namespace

void LeTimer::reset() {
    LowEnergy::reset();
    clear_count();
    running = buffered = false;
    for (int n = 0; n < 2; n++) {
        outputs[n] = pulsing[n] = false;
        part.gpio->release(route::LETIMER0_OUT0 + n, this);
    }
}

uint32_t LeTimer::top() const { return reg(CTRL) & CTRL_COMP0TOP ? reg(COMP0) : LAST; }

uint32_t LeTimer::action(int output) const {
    return field(reg(CTRL), output ? CTRL_UFOA1 : CTRL_UFOA0);
}

void LeTimer::pass(int64_t passed) {
    while (passed > 0 && running) {
        // Free running without outputs: whole turns but the last two change nothing.
        const int64_t turn = (int64_t)top() + 1;
        if (repeat_mode() == FREE && value <= top() && passed > 4 * turn && !outputs_matter())
            passed = passed % turn + 2 * turn;
        if (pulsing[0] || pulsing[1])
            for (int n = 0; n < 2; n++)
                outputs[n] = outputs[n] && !pulsing[n], pulsing[n] = false;
        int64_t next = std::min(passed, (int64_t)value + 1);
        for (const uint32_t compare : {reg(COMP0), reg(COMP1)})
            if (compare <= value)
                next = std::min(next, (int64_t)value - compare + 1);
        if (outputs_matter() && reg(COMP1) < value)
            next = std::min(next, (int64_t)value - reg(COMP1));
        if (outputs_matter())
            next = std::min<int64_t>(next, action(0) == PULSE || action(1) == PULSE ? 1 : next);
        const bool under = next == (int64_t)value + 1;
        // The counter leaves this value.
        const uint32_t left = (uint32_t)(value - next + 1);
        uint32_t flags = (under ? IF_UF : 0) | (left == reg(COMP0) ? IF_COMP0 : 0) |
                         (left == reg(COMP1) ? IF_COMP1 : 0);
        value = under ? top() : left - 1;
        passed -= next;
        if (under)
            underflow();
        // The output has its level as soon as the counter has the value.
        if (value == reg(COMP1))
            for (int n = 0; n < 2; n++)
                if (action(n) == PWM && reg(n ? REP1 : REP0))
                    outputs[n] = true;
        if (flags)
            raise(flags);
        show_outputs();
    }
}

void LeTimer::underflow() {
    for (int n = 0; n < 2; n++)
        if (reg(n ? REP1 : REP0)) {
            if (action(n) == TOGGLE)
                outputs[n] = !outputs[n];
            if (action(n) == PULSE)
                outputs[n] = pulsing[n] = true;
            if (action(n) == PWM)
                outputs[n] = false;
        }
    switch (repeat_mode()) {
    case FREE: break;
    case ONE_SHOT:
        count_down(0);
        running = reg(REP0) != 0;
        break;
    case BUFFERED:
        count_down(0);
        if (!reg(REP0)) {
            if (buffered && reg(REP1)) {
                reg(REP0) = reg(REP1);
                reg(IF) |= IF_REP1;
                if (reg(CTRL) & CTRL_BUFTOP)
                    reg(COMP0) = reg(COMP1);
                buffered = false;
            } else {
                running = false;
            }
        }
        break;
    case DOUBLE:
        count_down(0);
        count_down(1);
        running = reg(REP0) || reg(REP1);
        break;
    }
    if (!running)
        reg(STATUS) &= ~STATUS_RUNNING;
}

void LeTimer::count_down(int which) {
    uint32_t &left = reg(which ? REP1 : REP0);
    if (left && !--left)
        reg(IF) |= which ? IF_REP1 : IF_REP0;
}

int64_t LeTimer::until(uint32_t wanted) const {
    if (wanted < value) return (int64_t)value - wanted;
    return wanted <= top() ? (int64_t)value + 1 + top() - wanted : FAR;
}

int64_t LeTimer::until_left(uint32_t wanted) const {
    if (wanted == value) return 1;
    const int64_t reached = until(wanted);
    return reached == FAR ? FAR : reached + 1;
}

bool LeTimer::outputs_matter() const {
    for (int n = 0; n < 2; n++)
        if (action(n) && (pin(n) >= 0 || part.prs->listens(REFLEX, n))) return true;
    return false;
}

int64_t LeTimer::next_effect() const {
    if (pulsing[0] || pulsing[1]) return 1;
    const uint32_t awaited = reg(IEN) & ~reg(IF);
    int64_t next = FAR;
    if (repeat_mode() != FREE || awaited & (IF_UF | IF_REP0 | IF_REP1) || outputs_matter())
        next = (int64_t)value + 1;
    if (awaited & IF_COMP0)
        next = std::min(next, until_left(reg(COMP0)));
    if (awaited & IF_COMP1)
        next = std::min(next, until_left(reg(COMP1)));
    if (outputs_matter())
        next = std::min(next, until(reg(COMP1)));
    return next;
}

void LeTimer::start() {
    if (running) return;
    running = true;
    reg(STATUS) |= STATUS_RUNNING;
    restart_clock();
}

void LeTimer::stop() {
    running = false;
    reg(STATUS) &= ~STATUS_RUNNING;
}

void LeTimer::compare_matched(int compare) {
    if (!awaits(compare)) return;
    fold();
    start();
    plan();
}

bool LeTimer::awaits(int compare) const {
    return reg(CTRL) & (compare ? CTRL_RTCC1TEN : CTRL_RTCC0TEN);
}

uint32_t LeTimer::after(int64_t ticks) const {
    if (ticks <= value) return (uint32_t)(value - ticks);
    return top() - (uint32_t)((ticks - value - 1) % ((int64_t)top() + 1));
}

void LeTimer::write(uint32_t offset, uint32_t written) {
    fold();
    LowEnergy::write(offset, written);
    show_outputs();
    plan();
}

void LeTimer::apply(uint32_t offset, uint32_t written) {
    fold();
    if (offset == CMD) {
        if (written & CMD_CLEAR)
            value = 0;
        if (written & CMD_CTO0)
            outputs[0] = false;
        if (written & CMD_CTO1)
            outputs[1] = false;
        if (written & CMD_STOP)
            stop();
        else if (written & CMD_START)
            start();
    } else {
        LowEnergy::apply(offset, written);
        if (offset == REP1)
            buffered = true;
    }
    show_outputs();
    plan();
}

// -- outputs --

int LeTimer::pin(int output) const {
    const uint32_t enable = output ? ROUTE_OUT1PEN : ROUTE_OUT0PEN;
    return reg(ROUTE) & enable
        ? ROUTES[route::LETIMER0_OUT0 + output][field(reg(ROUTE), ROUTE_LOCATION)] : -1;
}

void LeTimer::show_outputs() {
    for (int n = 0; n < 2; n++) {
        part.prs->set(REFLEX, n, outputs[n]);
        if (const int to = pin(n); to >= 0)
            part.gpio->function(to, this, true,
                                outputs[n] != !!(reg(CTRL) & (n ? CTRL_OPOL1 : CTRL_OPOL0)));
    }
}

}  // namespace efm32gg
