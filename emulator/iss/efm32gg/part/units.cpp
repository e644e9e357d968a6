// Creates the part's peripherals, and finds serial units by number or pin.
#include "armv7m/core/cpu.h"
#include "efm32gg/analog/adc.h"
#include "efm32gg/analog/comparator.h"
#include "efm32gg/clocks/cmu.h"
#include "efm32gg/clocks/emu.h"
#include "efm32gg/clocks/rmu.h"
#include "efm32gg/memory/dma.h"
#include "efm32gg/memory/ebi.h"
#include "efm32gg/memory/msc.h"
#include "efm32gg/part/part.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"
#include "efm32gg/serial/i2c.h"
#include "efm32gg/serial/leuart.h"
#include "efm32gg/serial/usart.h"
#include "efm32gg/timers/letimer.h"
#include "efm32gg/timers/pulse_counter.h"
#include "efm32gg/timers/real_time.h"
#include "efm32gg/timers/timer.h"
#include "efm32gg/timers/wdog.h"

namespace efm32gg {

// From here on a unit's number is a port pin: port * 16 + bit.
static constexpr int PINS = 0x100;

void Part::add_units() {
    owned.reserve(64);
    cmu = add(new Cmu(*this, instance::CMU));
    emu = add(new Emu(*this, instance::EMU));
    rmu = add(new Rmu(*this, instance::RMU));
    msc = add(new Msc(*this, instance::MSC));
    gpio = add(new Gpio(*this, instance::GPIO));
    ebi = add(new Ebi(*this, instance::EBI));
    prs = add(new Prs(*this, instance::PRS));
    add(new Wdog(*this, instance::WDOG));
    dma = add(new Dma(*this, instance::DMA));
    // Numbers: DMA source, then PRS source (CHn_CTRL of either), then the first of the unit's pins.
    usarts = {add(new Usart(*this, instance::USART0, 12, 16, route::USART0_TX)),
              add(new Usart(*this, instance::USART1, 13, 17, route::USART1_TX)),
              add(new Usart(*this, instance::USART2, 14, 18, route::USART2_TX)),
              add(new Usart(*this, instance::UART0, 44, 41, route::UART0_TX)),
              add(new Usart(*this, instance::UART1, 45, 42, route::UART1_TX))};
    leuarts = {add(new Leuart(*this, instance::LEUART0, 16, route::LEUART0_TX)),
               add(new Leuart(*this, instance::LEUART1, 17, route::LEUART1_TX))};
    i2cs = {add(new I2c(*this, instance::I2C0, 20, route::I2C0_SDA)),
            add(new I2c(*this, instance::I2C1, 21, route::I2C1_SDA))};
    timers = {add(new Timer(*this, instance::TIMER0, 24, 28, route::TIMER0_CC0)),
              add(new Timer(*this, instance::TIMER1, 25, 29, route::TIMER1_CC0)),
              add(new Timer(*this, instance::TIMER2, 26, 30, route::TIMER2_CC0)),
              add(new Timer(*this, instance::TIMER3, 27, 31, route::TIMER3_CC0))};
    auto *letimer = add(new LeTimer(*this, instance::LETIMER0));
    add(new Rtc(*this, instance::RTC))->letimer = letimer;
    add(new Burtc(*this, instance::BURTC));
    add(new PulseCounter(*this, instance::PCNT0, route::PCNT0_S0IN));
    add(new PulseCounter(*this, instance::PCNT1, route::PCNT1_S0IN));
    add(new PulseCounter(*this, instance::PCNT2, route::PCNT2_S0IN));
    add(new Adc(*this, instance::ADC0));
    add(new Peripheral(*this, instance::DAC0));  // registers only, no output voltage
    auto *first = add(new Acmp(*this, instance::ACMP0));
    auto *second = add(new Acmp(*this, instance::ACMP1));
    first->partner = second;
    second->partner = first;
    add(new Vcmp(*this, instance::VCMP));
    for (const Instance *one : INSTANCES)
        if (one->base >= PERIPHERALS && !peripheral_at(one->base))
            add(new Unmodelled(*this, *one));
}

void Part::uart_receive(int unit, uint32_t data, uint32_t flags) {
    const auto offer = [&](auto *one, int number) {
        if (unit == number || (unit >= PINS && one->receive_pin() == unit - PINS))
            one->receive(data, flags & 1, flags & 2, flags >> 8);
    };
    for (int n = 0; n < 5; n++)
        offer(usarts[n], n);
    for (int n = 0; n < 2; n++)
        offer(leuarts[n], Leuart::FIRST_UNIT + n);
}

I2c *Part::i2c_unit(int unit) const {
    for (int n = 0; n < 2; n++)
        if (unit == n || (unit >= PINS && i2cs[n]->data_pin() == unit - PINS))
            return i2cs[n];
    return nullptr;
}

}  // namespace efm32gg
