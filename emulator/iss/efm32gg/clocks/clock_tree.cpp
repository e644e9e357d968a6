// The clock tree: frequencies as the CMU's registers select them. EFM32GG Reference Manual, 11.3.1.
#include "efm32gg/clocks/cmu.h"

namespace efm32gg {

using namespace cmu;

// Centre frequencies of the bands: data sheet, 3.9 (early parts had 1 and 7 MHz).
static constexpr uint32_t BANDS[8] = {1200000, 6600000, 11000000, 14000000,
                                      21000000, 28000000, 28000000, 28000000};
static constexpr uint32_t AUX_BANDS[8] = {14000000, 11000000, 6600000, 1200000,
                                          14000000, 14000000, 28000000, 21000000};
// A tuning step of an RC oscillator, in thousandths of the frequency; 0x80 and 0x40 are nominal.
static constexpr int TUNING_STEP = 3;

#define HIGH(unit) {&instance::unit, HFPERCLKEN0, HFPERCLKEN0_##unit, false, -1, 0, 0},
#define CORE(unit) {&instance::unit, HFCORECLKEN0, HFCORECLKEN0_##unit, false, -1, 0, 0},
#define LOW(unit) {&instance::unit, HFCORECLKEN0, HFCORECLKEN0_LE, true, -1, 0, 0},
#define PULSE(unit) \
    {&instance::unit, HFCORECLKEN0, HFCORECLKEN0_LE, true, -1, PCNTCTRL_##unit##CLKEN, \
     PCNTCTRL_##unit##CLKSEL},
#define LOW_A(unit) \
    {&instance::unit, HFCORECLKEN0, HFCORECLKEN0_LE, true, 0, LFACLKEN0_##unit, LFAPRESC0_##unit},
#define LOW_B(unit) \
    {&instance::unit, HFCORECLKEN0, HFCORECLKEN0_LE, true, 2, LFBCLKEN0_##unit, LFBPRESC0_##unit},

// Units with an enable bit; all others are always on.
const Cmu::Enable Cmu::UNITS[] = {
    HIGH(USART0) HIGH(USART1) HIGH(USART2) HIGH(UART0) HIGH(UART1) HIGH(TIMER0) HIGH(TIMER1)
    HIGH(TIMER2) HIGH(TIMER3) HIGH(ACMP0) HIGH(ACMP1) HIGH(I2C0) HIGH(I2C1) HIGH(GPIO) HIGH(VCMP)
    HIGH(PRS) HIGH(ADC0) HIGH(DAC0)
    CORE(DMA) CORE(AES) CORE(EBI)
    LOW(WDOG) LOW(BURTC) PULSE(PCNT0) PULSE(PCNT1) PULSE(PCNT2)
    LOW_A(LESENSE) LOW_A(RTC) LOW_A(LETIMER0)
    LOW_B(LEUART0) LOW_B(LEUART1)
};

#undef HIGH
#undef CORE
#undef LOW
#undef PULSE
#undef LOW_A
#undef LOW_B

bool Cmu::running(int oscillator) const {
    const bool low_frequency = oscillator == LFRCO || oscillator == LFXO;
    return oscillators[oscillator].ready &&
           (sleeping < 2 || (sleeping != 3 && low_frequency));
}

uint32_t Cmu::hertz(const Cmu &cmu, int oscillator) {
    const auto tuned = [&](uint32_t nominal, uint32_t tuning, int middle) {
        return (uint32_t)((int64_t)nominal * (1000 + TUNING_STEP * ((int)tuning - middle)) / 1000);
    };
    switch (oscillator) {
    case HFRCO:
        return tuned(BANDS[field(cmu.reg(HFRCOCTRL), HFRCOCTRL_BAND)],
                     field(cmu.reg(HFRCOCTRL), HFRCOCTRL_TUNING), 0x80);
    case AUXHFRCO:
        return tuned(AUX_BANDS[field(cmu.reg(AUXHFRCOCTRL), AUXHFRCOCTRL_BAND)],
                     field(cmu.reg(AUXHFRCOCTRL), AUXHFRCOCTRL_TUNING), 0x80);
    case LFRCO: return tuned(LF_HERTZ, cmu.reg(LFRCOCTRL), 0x40);
    case HFXO: return HFXO_HERTZ;
    default: return LF_HERTZ;
    }
}

Rate Cmu::clock_of(int oscillator, int64_t now) const {
    return running(oscillator) ? Rate(hertz(*this, oscillator), 1, now) : Rate();
}

Rate Cmu::low_frequency(uint32_t select, bool ultra_low, int64_t now) const {
    if (select == 1 || select == 2) return clock_of(select == 1 ? LFRCO : LFXO, now);
    return select == 0 && ultra_low ? Rate(ULFRCO_HERTZ, 1, now) : Rate();
}

void Cmu::rates(Rates &rates, int64_t now) const {
    const uint32_t control = reg(CTRL), core = reg(HFCORECLKDIV), per = reg(HFPERCLKDIV);
    const auto power = [](uint32_t exponent) { return (int64_t)1 << (exponent > 9 ? 9 : exponent); };
    const auto divided = [&](const Rate &rate, int64_t by) {
        return rate.runs() ? rate.divided(by, now) : rate;
    };
    const Rate source = sleeping >= 2 ? Rate() : clock_of(selected, now);
    const Rate high = divided(source, field(control, CTRL_HFCLKDIV) + 1);
    Rate &hfcore = rates[(int)Clock::HFCORE];
    hfcore = divided(high, power(field(core, HFCORECLKDIV_HFCORECLKDIV)));
    rates[(int)Clock::HFPER] = per & HFPERCLKDIV_HFPERCLKEN
        ? divided(high, power(field(per, HFPERCLKDIV_HFPERCLKDIV))) : Rate();
    rates[(int)Clock::HFCORELE] = divided(hfcore, core & HFCORECLKDIV_HFCORECLKLEDIV ? 4 : 2);
    const uint32_t low = reg(LFCLKSEL);
    const uint32_t a = field(low, LFCLKSEL_LFA), b = field(low, LFCLKSEL_LFB);
    rates[(int)Clock::LFA] = a == 3 ? rates[(int)Clock::HFCORELE]
                                    : low_frequency(a, low & LFCLKSEL_LFAE, now);
    rates[(int)Clock::LFB] = b == 3 ? rates[(int)Clock::HFCORELE]
                                    : low_frequency(b, low & LFCLKSEL_LFBE, now);
    rates[(int)Clock::HFRCO] = clock_of(HFRCO, now);
    rates[(int)Clock::HFXO] = clock_of(HFXO, now);
    rates[(int)Clock::AUXHFRCO] = clock_of(AUXHFRCO, now);
    rates[(int)Clock::LFXO] = clock_of(LFXO, now);
    rates[(int)Clock::LFRCO] = clock_of(LFRCO, now);
    rates[(int)Clock::ULFRCO] = Rate(ULFRCO_HERTZ, 1, now);
}

const Cmu::Enable &Cmu::enable_of(const Instance &instance) {
    static const Enable always = {nullptr, 0, 0, false, -1, 0, 0};
    for (const Enable &unit : UNITS)
        if (unit.instance->base == instance.base) return unit;
    return always;
}

Rate Cmu::unit_rate(const Instance &instance) const {
    const Enable &enable = enable_of(instance);
    if (enable.synced >= 0) {
        const Rate &clock = part.rate(enable.synced ? Clock::LFB : Clock::LFA);
        if (!(effective[enable.synced] & enable.enable) || !clock.runs()) return Rate();
        const uint32_t exponent = field(effective[enable.synced + 1], enable.prescaler);
        return clock.divided((int64_t)1 << exponent, clock.origin);
    }
    if (enable.enable && (!(reg(PCNTCTRL) & enable.enable) || clocked_by_pin(instance))) return Rate();
    if (enable.low_energy) return part.rate(Clock::LFA);
    if (!enabled(instance)) return Rate();
    return part.rate(enable.offset == HFPERCLKEN0 ? Clock::HFPER : Clock::HFCORE);
}

bool Cmu::clocked_by_pin(const Instance &instance) const {
    const Enable &enable = enable_of(instance);
    const uint32_t both = enable.enable | enable.prescaler;
    return (reg(PCNTCTRL) & both) == both;
}

void Cmu::check_limits() {
    const int64_t core = part.hertz(Clock::HFCORE);
    if (core > 32000000 && reg(HFCORECLKEN0) & HFCORECLKEN0_LE &&
        !(reg(CTRL) & CTRL_HFLE && reg(HFCORECLKDIV) & HFCORECLKDIV_HFCORECLKLEDIV))
        part.log_once("CMU: above 32 MHz the low-energy bus needs CTRL.HFLE and HFCORECLKLEDIV");
}

}  // namespace efm32gg
