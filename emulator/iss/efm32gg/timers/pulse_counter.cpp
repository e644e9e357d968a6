// PCNT: counts edges at its first input, in the direction given by CTRL or by its second input.
// EFM32GG Reference Manual, chapter 24. With LFACLK it counts each pulse, also one that is shorter
// than a clock. Not modelled: quadrature, filter, auxiliary counter.
#include "efm32gg/clocks/cmu.h"
#include "efm32gg/part/low_energy.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"

namespace efm32gg {

using namespace pcnt;

namespace {

class PulseCounter : public LowEnergy {
public:
    // `signals`: route::Signal of its first input; the second one follows.
    PulseCounter(Part &part, const Instance &instance, int signals)
        : LowEnergy(part, instance), signals(signals) {}

    void pin_changed(int port, int bit, bool level) override {
        if (port * 16 + bit == pin(0) && !(reg(INPUT) & INPUT_S0PRSEN))
            edge(level);
    }

    void prs_changed(int channel, bool level) override {
        if (reg(INPUT) & INPUT_S0PRSEN && (int)field(reg(INPUT), INPUT_S0PRSSEL) == channel)
            edge(level);
    }

    void clocks_changed() override {
        LowEnergy::clocks_changed();
        if (part.cmu->clocked_by_pin(instance))
            listen();
    }

private:
    const int signals;
    bool listening = false;

    void apply(uint32_t offset, uint32_t value) override {
        if (offset == CMD) {
            if (value & CMD_LTOPBIM)
                reg(TOP) = reg(TOPB);
            if (value & CMD_LCNTIM)
                reg(CNT) = reg(TOP);
            return;
        }
        LowEnergy::apply(offset, value);
        if (offset == TOPB)
            reg(TOP) = reg(TOPB);
        const uint32_t mode = field(reg(CTRL), CTRL_MODE);
        if (mode == 3)
            part.log_once("%s: quadrature decoding is not modelled", instance.name);
        if (reg(CTRL) & CTRL_RSTEN)
            reg(CNT) = 0, reg(TOP) = 0xFF;
        if (mode)
            listen();
    }

    void listen() {
        if (!listening)
            part.gpio->listen(*this);
        listening = true;
    }

    int pin(int signal) const {
        return ROUTES[signals + signal][field(reg(ROUTE), ROUTE_LOCATION)];
    }

    bool second_input() const {
        return reg(INPUT) & INPUT_S1PRSEN ? part.prs->level((int)field(reg(INPUT), INPUT_S1PRSSEL))
                                          : part.gpio->input(pin(1));
    }

    void edge(bool rising) {
        if (rising == !!(reg(CTRL) & CTRL_EDGE) || part.mode > 3) return;
        const bool clock = part.cmu->clocked_by_pin(instance);
        const uint32_t mode = field(reg(CTRL), CTRL_MODE);
        if (mode == 1 || mode == 2) {
            if (clock != (mode == 2))
                part.log_once("%s: CTRL.MODE %u needs the other clock of CMU.PCNTCTRL",
                              instance.name, (unsigned)mode);
            else if (clock || clock_now().runs())
                count_pulse();
        }
        if (clock)
            clock_edge();
    }

    void count_pulse() {
        const uint32_t control = reg(CTRL);
        if (control & CTRL_RSTEN) return;
        bool down = control & CTRL_CNTDIR;
        if (control & CTRL_S1CDIR)
            down = !second_input();
        if (down != !!(reg(STATUS) & STATUS_DIR)) {
            reg(STATUS) = down ? STATUS_DIR : 0;
            raise(IF_DIRCNG);
        }
        const uint32_t counted = field(control, CTRL_CNTEV);  // both, up, down, none
        if (counted == 3 || (counted == 1 && down) || (counted == 2 && !down)) return;
        uint32_t &count = reg(CNT);
        if (down) {
            if (!count)
                raise(IF_UF);
            count = count ? count - 1 : reg(TOP);
        } else {
            if (count >= reg(TOP))
                raise(IF_OF);
            count = count >= reg(TOP) ? 0 : count + 1;
        }
    }
};

}  // namespace

void add_pulse_counters(Part &part) {
    part.add(new PulseCounter(part, instance::PCNT0, route::PCNT0_S0IN));
    part.add(new PulseCounter(part, instance::PCNT1, route::PCNT1_S0IN));
    part.add(new PulseCounter(part, instance::PCNT2, route::PCNT2_S0IN));
}

}  // namespace efm32gg
