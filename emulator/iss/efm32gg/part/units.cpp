// The serial, counting and analog units and the DMA: who they are, and how the outside finds them.
#include "efm32gg/analog/adc.h"
#include "efm32gg/analog/comparator.h"
#include "efm32gg/memory/dma.h"
#include "efm32gg/part/part.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/serial/i2c.h"
#include "efm32gg/serial/leuart.h"
#include "efm32gg/serial/usart.h"
#include "efm32gg/timers/letimer.h"
#include "efm32gg/timers/pulse_counter.h"
#include "efm32gg/timers/real_time.h"
#include "efm32gg/timers/timer.h"

namespace efm32gg {

// The units that the outside addresses by number, or by the port pin of their line.
struct Interfaces {
    Usart *usart[5];
    Leuart *leuart[2];
    I2c *i2c[2];
    Timer *timer[4];
};

namespace {

// From here on a unit's number is a port pin: port * 16 + bit.
constexpr int PINS = 0x100;

}  // namespace

void add_interfaces(Part &part) {
    part.dma = part.add(new Dma(part, instance::DMA));
    auto *all = new Interfaces;
    part.interfaces.reset(all);
    const struct {
        const Instance &instance;
        Usart::Place place;
    } usarts[] = {
        {instance::USART0, {0, 12, 16, route::USART0_TX}},
        {instance::USART1, {1, 13, 17, route::USART1_TX}},
        {instance::USART2, {2, 14, 18, route::USART2_TX}},
        {instance::UART0, {3, 44, 41, route::UART0_TX}},
        {instance::UART1, {4, 45, 42, route::UART1_TX}},
    };
    for (int n = 0; n < 5; n++)
        all->usart[n] = part.add(new Usart(part, usarts[n].instance, usarts[n].place));
    all->leuart[0] = part.add(new Leuart(part, instance::LEUART0, 5, 16, route::LEUART0_TX));
    all->leuart[1] = part.add(new Leuart(part, instance::LEUART1, 6, 17, route::LEUART1_TX));
    all->i2c[0] = part.add(new I2c(part, instance::I2C0, 20, route::I2C0_SDA));
    all->i2c[1] = part.add(new I2c(part, instance::I2C1, 21, route::I2C1_SDA));
    all->timer[0] = part.add(new Timer(part, instance::TIMER0, 24, 28, route::TIMER0_CC0));
    all->timer[1] = part.add(new Timer(part, instance::TIMER1, 25, 29, route::TIMER1_CC0));
    all->timer[2] = part.add(new Timer(part, instance::TIMER2, 26, 30, route::TIMER2_CC0));
    all->timer[3] = part.add(new Timer(part, instance::TIMER3, 27, 31, route::TIMER3_CC0));
    for (Timer *timer : all->timer)
        timer->connect(all->timer);
    auto *letimer = part.add(new LeTimer(part, instance::LETIMER0));
    part.add(new Rtc(part, instance::RTC))->started = letimer;
    part.add(new Burtc(part, instance::BURTC));
    part.add(new PulseCounter(part, instance::PCNT0, route::PCNT0_S0IN));
    part.add(new PulseCounter(part, instance::PCNT1, route::PCNT1_S0IN));
    part.add(new PulseCounter(part, instance::PCNT2, route::PCNT2_S0IN));
    part.add(new Adc(part, instance::ADC0));
    part.add(new Peripheral(part, instance::DAC0));  // its registers, and no voltage
    auto *first = part.add(new Acmp(part, instance::ACMP0));
    auto *second = part.add(new Acmp(part, instance::ACMP1));
    first->partner = second;
    second->partner = first;
    part.add(new Vcmp(part, instance::VCMP));
}

// `flags`: bit 0 framing error, bit 1 parity error; from bit 8 the line's bit rate, 0: unknown.
void Part::uart_receive(int unit, uint32_t data, uint32_t flags) {
    const auto offer = [&](auto *one, int number) {
        if (unit == number || (unit >= PINS && one->receive_pin() == unit - PINS))
            one->receive(data, flags & 1, flags & 2, flags >> 8);
    };
    for (int n = 0; n < 5; n++)
        offer(interfaces->usart[n], n);
    for (int n = 0; n < 2; n++)
        offer(interfaces->leuart[n], 5 + n);
}

// The unit by number or SDA pin; null when nobody is there.
I2c *Part::i2c_unit(int unit) const {
    for (int n = 0; n < 2; n++)
        if (unit == n || (unit >= PINS && interfaces->i2c[n]->data_pin() == unit - PINS))
            return interfaces->i2c[n];
    return nullptr;
}

int Part::i2c_slave_start(int unit, int address_byte) {
    I2c *one = i2c_unit(unit);
    return one ? one->slave_start((uint32_t)address_byte) : 0;
}

int Part::i2c_slave_write(int unit, int byte) {
    I2c *one = i2c_unit(unit);
    return one ? one->slave_write((uint32_t)byte) : 0;
}

int Part::i2c_slave_read(int unit, bool acknowledged) {
    I2c *one = i2c_unit(unit);
    return one ? one->slave_read(acknowledged) : 0xFF;
}

int Part::i2c_slave_stop(int unit) {
    if (I2c *one = i2c_unit(unit))
        one->slave_stop();
    return 0;
}

int Part::i2c_slave_poll(int unit) {
    I2c *one = i2c_unit(unit);
    return one ? one->slave_poll() : 0;
}

void Part::i2c_answer(int unit, int acknowledged, int data) {
    if (I2c *one = i2c_unit(unit))
        one->answer(acknowledged, (uint32_t)data);
}

}  // namespace efm32gg
