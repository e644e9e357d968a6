// Comparators: ACMP of two voltages, VCMP of the supply. EFM32GG Reference Manual, chapters 26
// and 27. They compare when an input or their registers change; the response time is not modelled.
// Not modelled: capacitive sense; DAC outputs are 0 V.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

// Common to both: enable, warm-up, an output with edges.
class Comparator : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;
    void analog_changed() override { compare(); }

protected:
    // Whether the positive input is above the negative one; `before`: the output now, for
    // hysteresis.
    virtual bool above(bool before) const = 0;
    virtual int reflex() const = 0;
    virtual void drive_output(bool output) { (void)output; }
    virtual uint32_t inactive_output() const = 0;
    double volts(int input) const;

private:
    Event warmed = Event::of<&Comparator::on_warmed>(this);

    void warm_up();
    void on_warmed(int64_t time);
    void compare();
    void set_output(bool output, bool interrupts);
};

class Acmp : public Comparator {
public:
    using Comparator::Comparator;

    Acmp *partner = nullptr;  // on the same interrupt line

private:
    bool above(bool before) const override;
    int reflex() const override { return 2 + instance.index; }
    uint32_t inactive_output() const override { return reg(acmp::CTRL) & acmp::CTRL_INACTVAL; }
    void drive_output(bool output) override;
    void update_interrupts() override;
};

class Vcmp : public Comparator {
public:
    using Comparator::Comparator;

private:
    bool above(bool before) const override;
    int reflex() const override { return 1; }
    uint32_t inactive_output() const override { return reg(vcmp::CTRL) & vcmp::CTRL_INACTVAL; }
};

}  // namespace efm32gg
