// Creates the part's peripherals, and finds serial units by number or pin.
#include "armv7m/core/cpu.h"
#include "efm32gg/analog/dac.h"
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
#include "efm32gg/serial/serial_port.h"
#include "efm32gg/timers/timer.h"

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
    add_watchdog(*this);
    dma = add(new Dma(*this, instance::DMA));
    add_aes(*this);
    // Numbers: DMA source, then PRS source (CHn_CTRL of either), then the first of the unit's pins.
    add_usart(*this, instance::USART0, 12, 16, route::USART0_TX);
    add_usart(*this, instance::USART1, 13, 17, route::USART1_TX);
    add_usart(*this, instance::USART2, 14, 18, route::USART2_TX);
    add_usart(*this, instance::UART0, 44, 41, route::UART0_TX);
    add_usart(*this, instance::UART1, 45, 42, route::UART1_TX);
    add_leuart(*this, instance::LEUART0, 16, route::LEUART0_TX);
    add_leuart(*this, instance::LEUART1, 17, route::LEUART1_TX);
    i2cs = {add(new I2c(*this, instance::I2C0, 20, route::I2C0_SDA)),
            add(new I2c(*this, instance::I2C1, 21, route::I2C1_SDA))};
    timers = {add(new Timer(*this, instance::TIMER0, 24, 28, route::TIMER0_CC0)),
              add(new Timer(*this, instance::TIMER1, 25, 29, route::TIMER1_CC0)),
              add(new Timer(*this, instance::TIMER2, 26, 30, route::TIMER2_CC0)),
              add(new Timer(*this, instance::TIMER3, 27, 31, route::TIMER3_CC0))};
    add_low_energy_timers(*this);
    add_pulse_counters(*this);
    add_adc(*this);
    dac = add(new Dac(*this, instance::DAC0));
    add_comparators(*this);
    add_lesense(*this);
}

void Part::uart_receive(int unit, uint32_t data, uint32_t flags) {
    for (size_t n = 0; n < receivers.size(); n++)
        if (unit == (int)n || (unit >= PINS && receivers[n]->receive_pin() == unit - PINS))
            receivers[n]->receive(data, flags & 1, flags & 2, flags >> 8);
}

I2c *Part::i2c_unit(int unit) const {
    for (int n = 0; n < 2; n++)
        if (unit == n || (unit >= PINS && i2cs[n]->data_pin() == unit - PINS))
            return i2cs[n];
    return nullptr;
}

}  // namespace efm32gg
