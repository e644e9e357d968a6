// Comparators: ACMP of two voltages, VCMP of the supply. EFM32GG Reference Manual, chapters 26
// and 27. They compare when an input or their registers change; the response time is not modelled.
// Not modelled: capacitive sense.
#include "efm32gg/analog/comparator.h"

#include "efm32gg/analog/dac.h"
#include "efm32gg/part/part.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"

#include <algorithm>
#include <iterator>

namespace efm32gg {

// These are equal in ACMP and VCMP.
static constexpr uint32_t CTRL = acmp::CTRL, STATUS = acmp::STATUS;
static_assert(+vcmp::CTRL == +acmp::CTRL && +vcmp::STATUS == +acmp::STATUS &&
                  +vcmp::IF == +acmp::IF,
              "ACMP and VCMP share a base class");
static_assert(+acmp::CTRL_EN == +vcmp::CTRL_EN && +acmp::CTRL_IRISE == +vcmp::CTRL_IRISE &&
              +acmp::CTRL_IFALL == +vcmp::CTRL_IFALL &&
              +acmp::CTRL_WARMTIME == +vcmp::CTRL_WARMTIME);
static_assert(+acmp::STATUS_ACMPACT == +vcmp::STATUS_VCMPACT &&
              +acmp::STATUS_ACMPOUT == +vcmp::STATUS_VCMPOUT && +acmp::IF_EDGE == +vcmp::IF_EDGE);

namespace {

constexpr uint32_t ACTIVE = acmp::STATUS_ACMPACT, OUTPUT = acmp::STATUS_ACMPOUT;
// Volts at CTRL_HYSTSEL, one way; data sheet, 3.12, typical.
constexpr double HYSTERESIS[] = {0, 0.015, 0.022, 0.029, 0.036, 0.043, 0.050, 0.057};
constexpr double SUPPLY_HYSTERESIS = 0.010;

// Common to both: enable, warm-up, an output with edges.
class Comparator : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override {
        Peripheral::reset();
        part.cancel(warmed);
    }

    void write(uint32_t offset, uint32_t value) override {
        const bool was = reg(CTRL) & acmp::CTRL_EN;
        Peripheral::write(offset, value);
        const bool is = reg(CTRL) & acmp::CTRL_EN;
        if (is && !was) {
            warm_up();
        } else if (!is) {
            part.cancel(warmed);
            reg(STATUS) &= ~ACTIVE;
        }
        if (offset == CTRL && !(reg(STATUS) & ACTIVE))
            set_output(inactive_output(), false);
        compare();
    }

    void clocks_changed() override {
        if (reg(CTRL) & acmp::CTRL_EN && !(reg(STATUS) & ACTIVE) && !warmed.pending())
            warm_up();
    }

    void analog_changed() override { compare(); }

protected:
    // Whether the positive input is above the negative one; `before`: the output now, for
    // hysteresis.
    virtual bool above(bool before) const = 0;
    virtual int reflex() const = 0;
    virtual void drive_output(bool output) { (void)output; }
    virtual uint32_t inactive_output() const = 0;

private:
    Event warmed = Event::of<&Comparator::on_warmed>(this);

    // Takes 4 to 512 cycles of HFPERCLK.
    void warm_up() {
        const int64_t cycles = (int64_t)4 << field(reg(CTRL), acmp::CTRL_WARMTIME);
        if (clock_now().runs())
            part.schedule_after(warmed, clock_now().span(cycles));
    }

    void on_warmed(int64_t) {
        reg(STATUS) |= ACTIVE;
        raise(acmp::IF_WARMUP);
        compare();  // a change from the inactive value counts as an edge
    }

    void compare() {
        if (reg(STATUS) & ACTIVE && part.mode < 4)
            set_output(above(reg(STATUS) & OUTPUT), true);
    }

    void set_output(bool output, bool interrupts) {
        const bool before = reg(STATUS) & OUTPUT;
        set_bits(reg(STATUS), OUTPUT, output);
        drive_output(output);
        if (before == output) return;
        part.prs->set(reflex(), 0, output);
        if (interrupts && reg(CTRL) & (output ? acmp::CTRL_IRISE : acmp::CTRL_IFALL))
            raise(acmp::IF_EDGE);
    }
};

class Acmp : public Comparator, public SensorComparator {
public:
    using Comparator::Comparator;

    Acmp *partner = nullptr;  // on the same interrupt line

    bool sense(int channel, int level, bool before) const override {
        uint32_t selected = reg(acmp::INPUTSEL);
        if (channel >= 0)
            selected = (selected & ~acmp::INPUTSEL_POSSEL) | (uint32_t)channel;
        if (level >= 0)
            selected = (selected & ~acmp::INPUTSEL_VDDLEVEL) |
                       to_field((uint32_t)level, acmp::INPUTSEL_VDDLEVEL);
        return above(selected, before);
    }

private:
    bool above(bool before) const override { return above(reg(acmp::INPUTSEL), before); }

    // `selected`: as INPUTSEL.
    bool above(uint32_t selected, bool before) const {
        const int channels = instance.index ? analog::ACMP1_CH0 : analog::ACMP0_CH0;
        const uint32_t negative = field(selected, acmp::INPUTSEL_NEGSEL);
        const double supply = part.volts(analog::VDD);
        double against = 0;
        if (negative < 8)
            against = part.volts(channels + (int)negative);
        else if (negative == 8)
            against = 1.25;
        else if (negative == 9)
            against = 2.5;
        else if (negative == 10)
            against = supply * field(selected, acmp::INPUTSEL_VDDLEVEL) / 63;
        else if (negative == 12 || negative == 13)
            against = part.dac->internal_volts((int)negative - 12);
        const double step = HYSTERESIS[field(reg(CTRL), acmp::CTRL_HYSTSEL)];
        return part.volts(channels + (int)field(selected, acmp::INPUTSEL_POSSEL)) >
               against + (before ? -step : step);
    }

    int reflex() const override { return 2 + instance.index; }
    uint32_t inactive_output() const override { return reg(acmp::CTRL) & acmp::CTRL_INACTVAL; }

    void drive_output(bool output) override {
        const uint32_t routed = reg(acmp::ROUTE), location = field(routed, acmp::ROUTE_LOCATION);
        if (routed & acmp::ROUTE_ACMPPEN)
            part.gpio->function(ROUTES[route::ACMP0_OUT + instance.index][location], this, true,
                                output != !!(reg(CTRL) & acmp::CTRL_GPIOINV));
    }

    void update_interrupts() override { line(0, pending() || (partner && partner->pending())); }
};

class Vcmp : public Comparator {
public:
    using Comparator::Comparator;

private:
    // The level is 1.667 V and 34 mV per step (27.3.3).
    bool above(bool before) const override {
        const double step = reg(CTRL) & vcmp::CTRL_HYSTEN ? SUPPLY_HYSTERESIS : 0;
        const double level = 1.667 + 0.034 * field(reg(vcmp::INPUTSEL), vcmp::INPUTSEL_TRIGLEVEL);
        return part.volts(analog::VDD) > level + (before ? -step : step);
    }

    int reflex() const override { return 1; }
    uint32_t inactive_output() const override { return reg(vcmp::CTRL) & vcmp::CTRL_INACTVAL; }
};

}  // namespace

void add_comparators(Part &part) {
    auto *first = part.add(new Acmp(part, instance::ACMP0));
    auto *second = part.add(new Acmp(part, instance::ACMP1));
    first->partner = second;
    second->partner = first;
    part.comparators[0] = first;
    part.comparators[1] = second;
    part.add(new Vcmp(part, instance::VCMP));
}

}  // namespace efm32gg
