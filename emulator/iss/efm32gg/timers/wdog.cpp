#include "efm32gg/timers/wdog.h"

namespace efm32gg {

using namespace wdog;

// Clock edges until a written register takes effect.
static constexpr int64_t SYNC_EDGES = 3;

void Wdog::reset() {
    Peripheral::reset();
    part.cancel(timeout);
    part.cancel(synchronised);
    effective = reg(CTRL);
    clearing = false;
    counted = 0;
    clock = Rate();
}

Rate Wdog::source(uint32_t control) const {
    static constexpr Clock CHOICE[] = {Clock::ULFRCO, Clock::LFRCO, Clock::LFXO, Clock::LFXO};
    return part.rate(CHOICE[field(control, CTRL_CLKSEL)]);
}

void Wdog::write(uint32_t offset, uint32_t value) {
    if (offset == CTRL) {
        if (reg(CTRL) & CTRL_LOCK)
            return;
        store(offset, value);
        reg(SYNCBUSY) |= SYNCBUSY_CTRL;
    } else if (offset == CMD && value & CMD_CLEAR) {
        clearing = true;
        reg(SYNCBUSY) |= SYNCBUSY_CMD;
    } else {
        return;
    }
    synchronise();
}

void Wdog::synchronise() {
    const Rate rate = source(reg(CTRL));
    if (reg(SYNCBUSY) && !synchronised.pending() && rate.runs())
        part.schedule(synchronised, rate.time(rate.edges(part.now()) + SYNC_EDGES));
}

void Wdog::on_synchronised(int64_t) {
    const bool was_on = effective & CTRL_EN;
    clocks_changing();
    effective = reg(CTRL);
    if (clearing || !was_on)
        counted = 0;
    clearing = false;
    reg(SYNCBUSY) = 0;
    restart();
}

// Whole periods of the clock are kept over clock changes and sleep.
void Wdog::clocks_changing() {
    if (!clock.runs())
        return;
    const int64_t now = part.now();
    counted += clock.edges(now) - clock.edges(since);
    since = now;
}

void Wdog::clocks_changed() {
    restart();
    synchronise();
}

void Wdog::restart() {
    const bool sleeps = (part.mode == 2 && !(effective & CTRL_EM2RUN)) ||
                        (part.mode == 3 && !(effective & CTRL_EM3RUN)) || part.mode == 4;
    clock = effective & CTRL_EN && !sleeps ? source(effective) : Rate();
    since = part.now();
    part.cancel(timeout);
    if (clock.runs())
        part.schedule(timeout, clock.time(clock.edges(since) + period() - counted));
}

void Wdog::on_timeout(int64_t) { part.request_reset(rmu::RSTCAUSE_WDOGRST); }

}  // namespace efm32gg
