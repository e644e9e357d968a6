// Watchdog timer. EFM32GG Reference Manual, chapter 12.
#include "efm32gg/part/synchronizer.h"

namespace efm32gg {

using namespace wdog;

namespace {

class Wdog : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override {
        Peripheral::reset();
        part.cancel(timeout);
        synchronised.clear();
        effective = reg(CTRL);
        clearing = false;
        counted = 0;
        clock = Rate();
    }

    void write(uint32_t offset, uint32_t value) override {
        if (offset == CTRL) {
            if (reg(CTRL) & CTRL_LOCK) return;
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

    // Whole periods of the clock are kept over clock changes and sleep.
    void clocks_changing() override {
        if (!clock.runs()) return;
        const int64_t now = part.now();
        counted += clock.edges(now) - clock.edges(since);
        since = now;
    }

    void clocks_changed() override {
        restart();
        synchronise();
    }

private:
    Event timeout = Event::of<&Wdog::on_timeout>(this);
    Synchronizer synchronised{part, Event::of<&Wdog::on_synchronised>(this)};
    uint32_t effective = 0;   // CTRL as it acts
    bool clearing = false;
    int64_t counted = 0;      // periods of the clock, up to `since`
    int64_t since = 0;
    Rate clock;

    int64_t period() const { return ((int64_t)8 << field(effective, wdog::CTRL_PERSEL)) + 1; }

    Rate source(uint32_t control) const {
        static constexpr Clock CHOICE[] = {Clock::ULFRCO, Clock::LFRCO, Clock::LFXO, Clock::LFXO};
        return part.rate(CHOICE[field(control, CTRL_CLKSEL)]);
    }

    void synchronise() {
        if (!reg(SYNCBUSY)) return;
        const Rate rate = source(reg(CTRL));
        synchronised.follow(rate);
        synchronised.start(rate);
    }

    void restart() {
        const bool sleeps = (part.mode == 2 && !(effective & CTRL_EM2RUN)) ||
                            (part.mode == 3 && !(effective & CTRL_EM3RUN)) || part.mode == 4;
        clock = effective & CTRL_EN && !sleeps ? source(effective) : Rate();
        since = part.now();
        part.cancel(timeout);
        if (clock.runs())
            part.schedule(timeout, clock.time(clock.edges(since) + period() - counted));
    }

    void on_timeout(int64_t) { part.request_reset(rmu::RSTCAUSE_WDOGRST); }

    void on_synchronised(int64_t) {
        const bool was_on = effective & CTRL_EN;
        synchronised.clear();
        clocks_changing();
        effective = reg(CTRL);
        if (clearing || !was_on)
            counted = 0;
        clearing = false;
        reg(SYNCBUSY) = 0;
        restart();
    }
};

}  // namespace

void add_watchdog(Part &part) { part.add(new Wdog(part, instance::WDOG)); }

}  // namespace efm32gg
