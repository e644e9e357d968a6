#include "efm32gg/serial/i2c.h"

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"

namespace efm32gg {

using namespace i2c;

namespace {

// Values of STATE_STATE (16.5.3).
enum : uint32_t { IDLE = 0, WAIT, START_SENT, ADDR, ADDRACK, DATA, DATAACK };

// By Master: the phase of an address, and of a byte after it.
constexpr uint32_t MASTER_PHASES[][2] = {
    {IDLE, IDLE}, {START_SENT, START_SENT}, {START_SENT, START_SENT}, {ADDR, DATA}, {ADDR, DATA},
    {ADDRACK, DATAACK}, {ADDRACK, DATAACK}, {DATA, DATA}, {DATA, DATA}, {DATA, DATA},
    {DATAACK, DATAACK}, {DATAACK, DATAACK}, {DATAACK, DATAACK}};

constexpr int HIGH_AND_LOW[] = {4 + 4, 6 + 3, 11 + 6, 4 + 4};  // CTRL_CLHR
constexpr int IDLE_CYCLES[] = {0, 40, 80, 160};                // CTRL_BITO
constexpr int LOW_CYCLES[] = {0, 40, 80, 160, 320, 1024, 1024, 1024};  // CTRL_CLTO

}  // namespace

void I2c::reset() {
    Peripheral::reset();
    for (Event *event : {&bits, &idle_timeout, &low_timeout})
        part.cancel(*event);
    const bool asked = slave_answer == WAITING;
    if (master != Master::IDLE)
        part.send(Kind::I2C_STOP, instance.index, 0);
    master = Master::IDLE;
    slave = Slave::IDLE;
    busy = true;
    transmit_full = receive_full = shift_full = holding = false;
    if (asked)
        release(0);
    follow();
}

int I2c::data_pin() const {
    constexpr uint32_t both = ROUTE_SDAPEN | ROUTE_SCLPEN;
    const uint32_t location = field(reg(ROUTE), ROUTE_LOCATION);
    const int data = ROUTES[signals][location], clock = ROUTES[signals + 1][location];
    const bool routed = (reg(ROUTE) & both) == both && part.gpio->readable(clock) >= 0;
    return routed ? part.gpio->readable(data) : -1;
}

bool I2c::usable() const {
    return reg(CTRL) & CTRL_EN && part.enabled(instance) && data_pin() >= 0;
}

int I2c::unit() const {
    const int pin = data_pin();
    return instance.index | (pin < 0 ? 0 : pin) << 8;
}

// Periods of SCL: (Nlow + Nhigh) * (CLKDIV + 1) + 4 cycles of HFPERCLK each (16.3.3).
int64_t I2c::bit(int64_t count) const {
    const int64_t cycles =
        HIGH_AND_LOW[field(reg(CTRL), CTRL_CLHR)] * ((int64_t)reg(CLKDIV) + 1) + 4;
    return clock_now().span(cycles * count);
}

// -- registers --

uint32_t I2c::peek(uint32_t offset) const {
    if (offset == RXDATA || offset == RXDATAP) return received;
    return Peripheral::peek(offset);
}

uint32_t I2c::read(uint32_t offset) {
    if (offset != RXDATA) return peek(offset);
    if (!receive_full) {
        raise(IF_RXUF);
        return received;
    }
    const uint32_t data = received;
    receive_full = false;
    deliver();
    proceed_all();
    return data;
}

void I2c::write(uint32_t offset, uint32_t value) {
    if (offset == CMD) return command(value);
    if (offset == TXDATA) {
        if (transmit_full) return raise(IF_TXOF);
        transmit = (uint8_t)value;
        transmit_full = true;
        reg(STATUS) &= ~STATUS_TXC;
    } else {
        const bool enabled = reg(CTRL) & CTRL_EN;
        Peripheral::write(offset, value);
        if (offset == CTRL && !(reg(CTRL) & CTRL_EN) && enabled) {
            end_master();  // disabling releases the bus
            slave = Slave::IDLE;
            shift_full = false;
            busy = true;
        }
        if (offset == CTRL)
            watch_idle();
    }
    proceed_all();
}

void I2c::command(uint32_t value) {
    if (value & CMD_CLEARTX)
        transmit_full = false;
    if (value & CMD_CLEARPC)
        reg(STATUS) &= ~(STATUS_PSTART | STATUS_PSTOP | STATUS_PACK | STATUS_PNACK | STATUS_PCONT);
    // The pending bits are in the order of the commands.
    reg(STATUS) |= value & (CMD_START | CMD_STOP | CMD_ACK | CMD_NACK | CMD_CONT);
    if (value & CMD_ABORT) {
        end_master();
        slave = Slave::IDLE;
        shift_full = false;
        busy = false;
        part.cancel(idle_timeout);
        if (slave_answer == WAITING)
            release(0);
    }
    proceed_all();
}

bool I2c::take_pending(uint32_t command) {
    const bool was = reg(STATUS) & command;
    reg(STATUS) &= ~command;
    return was;
}

void I2c::proceed_all() {
    proceed();
    proceed_slave();
    follow();
}

// -- time-outs: the bus held, idle, or low for too long --

void I2c::hold(bool on) {
    if (on && !holding) {
        reg(IF) |= IF_BUSHOLD;
        watch_low();
    } else if (!on && holding) {
        part.cancel(low_timeout);
    }
    holding = on;
}

void I2c::watch_low() {
    const int cycles = LOW_CYCLES[field(reg(CTRL), CTRL_CLTO)];
    const Rate rate = clock_now();
    if (cycles && rate.runs())
        part.schedule_after(low_timeout, rate.span(cycles * ((int64_t)reg(CLKDIV) + 1)));
}

void I2c::on_low_timeout(int64_t) { raise(IF_CLTO); }

// After enabling the bus counts as busy; BITO detects that it is idle (16.3.11).
void I2c::watch_idle() {
    part.cancel(idle_timeout);
    const int cycles = IDLE_CYCLES[field(reg(CTRL), CTRL_BITO)];
    const Rate rate = clock_now();
    if (cycles && busy && master == Master::IDLE && slave == Slave::IDLE &&
        reg(CTRL) & CTRL_EN && rate.runs())
        part.schedule_after(idle_timeout, rate.span(cycles * ((int64_t)reg(CLKDIV) + 1)));
}

void I2c::on_idle_timeout(int64_t) {
    if (reg(CTRL) & CTRL_GIBITO) {
        busy = false;
        proceed();
    }
    reg(IF) |= IF_BITO;
    follow();
}

// Updates STATE, flags, requests and interrupts.
void I2c::follow() {
    uint32_t phase = MASTER_PHASES[(int)master][!addressing];
    const bool acknowledging = phase == ADDRACK || phase == DATAACK;
    const bool nacked = acknowledging && refused;
    bool transmitter = master == Master::ACKED || master == Master::NACKED
        ? !to_read : master >= Master::START && master <= Master::ASKED;
    if (slave == Slave::ADDRESS) phase = ADDR, transmitter = shift & 1;
    if (slave == Slave::WRITE || slave == Slave::WRITTEN) phase = DATA;
    if (slave == Slave::READ || slave == Slave::LOAD)
        phase = first_read ? ADDRACK : DATAACK, transmitter = true;
    if (master == Master::IDLE && slave == Slave::IDLE && reg(STATUS) & STATUS_PSTART)
        phase = WAIT;
    reg(STATE) = (busy ? STATE_BUSY : 0) | (master != Master::IDLE ? STATE_MASTER : 0) |
                 (transmitter ? STATE_TRANSMITTER : 0) | (nacked ? STATE_NACKED : 0) |
                 (holding ? STATE_BUSHOLD : 0) | to_field(phase, STATE_STATE);
    uint32_t &status = reg(STATUS), &flags = reg(IF);
    set_bits(status, STATUS_TXBL, !transmit_full);
    set_bits(flags, IF_TXBL, !transmit_full);
    set_bits(status, STATUS_RXDATAV, receive_full);
    set_bits(flags, IF_RXDATAV, receive_full);
    part.dma->request(source, 0, receive_full);
    part.dma->request(source, 1, !transmit_full);
    update_interrupts();
}

}  // namespace efm32gg
