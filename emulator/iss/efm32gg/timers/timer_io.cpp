// Registers, outputs and inputs of TIMER. EFM32GG Reference Manual, chapter 20.
#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"
#include "efm32gg/timers/timer.h"

namespace efm32gg {

using namespace timer;

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
    case CNT: return current().value;
    case STATUS: return status();
    case CC0_CCVP: case CC1_CCVP: case CC2_CCVP: return reg(offset - 4);
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
            if (reg(CTRL) & CTRL_SYNC)
                for (Timer *other : part.timers)
                    if (other != this && other->reg(CTRL) & CTRL_SYNC) {
                        other->start();
                        other->plan();
                    }
        }
        break;
    case CNT: count.value = value & LAST; break;
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
    case DTLOCK: lock(DTLOCK, value, UNLOCK); break;
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
                inputs[n] = value & CC0_CTRL_INSEL
                                ? part.prs->level((int)field(value, CC0_CTRL_PRSSEL))
                                : part.gpio->input(pin(n));
            }
        }
        if (offset == ROUTE)
            for (int n = 0; n < CHANNELS; n++)
                part.gpio->release(signals + n, this);
    }
    const bool starts = reg(CTRL) & (CTRL_RISEA | CTRL_FALLA),
               counts_pin = field(reg(CTRL), CTRL_CLKSEL) == CHANNEL_1;
    if (!listening && (starts || counts_pin || cc_mode(0) == CAPTURE || cc_mode(1) == CAPTURE ||
                       cc_mode(2) == CAPTURE)) {
        part.gpio->listen(*this);
        listening = true;
    }
    show_outputs();
    plan();
}

// -- outputs --

int Timer::pin(int n) const {
    const bool routed = reg(ROUTE) & ROUTE_CC0PEN << n;
    return routed ? ROUTES[signals + n][field(reg(ROUTE), ROUTE_LOCATION)] : -1;
}

void Timer::act(int n, uint32_t action) {
    if (action == TOGGLE)
        outputs[n] = !outputs[n];
    else if (action != NONE)
        outputs[n] = action == SET;
}

void Timer::show_outputs() {
    for (int n = 0; n < CHANNELS; n++) {
        if (!compares(n)) continue;
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
        if (control & CC0_CTRL_INSEL && (int)field(control, CC0_CTRL_PRSSEL) == channel &&
            inputs[n] != level)
            edge(n, level);
    }
}

void Timer::edge(int n, bool rising) {
    inputs[n] = rising;
    if (!clock_now().runs() || within_edge) return;
    within_edge = true;
    fold();
    const uint32_t control = reg(cc(n, CC0_CTRL)), which = field(control, CC0_CTRL_ICEDGE);
    const bool wanted = which == 2 || (which == 0 && rising) || (which == 1 && !rising);
    if (n == 0) {
        const uint32_t action = field(reg(CTRL), rising ? CTRL_RISEA : CTRL_FALLA);
        if (action == RELOAD)
            count.value = mode() == DOWN ? reg(TOP) : 0;
        if (action == START || action == RELOAD)
            start();
        if (action == STOP)
            stop();
    }
    if (n == 1 && running && wanted && field(reg(CTRL), CTRL_CLKSEL) == CHANNEL_1)
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
    const uint32_t events = field(reg(cc(n, CC0_CTRL)), CC0_CTRL_ICEVCTRL);
    skipped[n] = !skipped[n];
    const bool signals_event = events == 0 || (events == 1 && !skipped[n]) ||
                               (events == 2 && inputs[n]) || (events == 3 && !inputs[n]);
    if (!signals_event) return;
    reg(IF) |= IF_CC0 << n;
    part.prs->pulse(reflex, 2 + n);
    part.dma->pulse(source, 1 + n);
    update_interrupts();
}

}  // namespace efm32gg
