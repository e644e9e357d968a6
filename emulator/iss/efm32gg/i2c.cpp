#include "i2c.h"

#include "dma.h"
#include "gpio.h"

namespace efm32gg {

using namespace i2c;

namespace {

// Values of STATE_STATE (16.5.3).
enum : uint32_t { IDLE = 0, WAIT, START_SENT, ADDR, ADDRACK, DATA, DATAACK };

constexpr int HIGH_AND_LOW[] = {4 + 4, 6 + 3, 11 + 6, 4 + 4};  // CTRL_CLHR
constexpr int IDLE_CYCLES[] = {0, 40, 80, 160};                // CTRL_BITO
constexpr int LOW_CYCLES[] = {0, 40, 80, 160, 320, 1024, 1024, 1024};  // CTRL_CLTO

}  // namespace

I2c::I2c(Part &part, const Instance &instance, int source, int signals)
    : Peripheral(part, instance), source(source), signals(signals) {}

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
    const uint32_t location = take(reg(ROUTE), ROUTE_LOCATION);
    if ((reg(ROUTE) & both) != both || location >= LOCATIONS || ROUTES[signals][location] < 0)
        return -1;
    const int data = ROUTES[signals][location], clock = ROUTES[signals + 1][location];
    return part.gpio->senses(data) && part.gpio->senses(clock) ? data : -1;
}

bool I2c::usable() const { return reg(CTRL) & CTRL_EN && part.enabled(instance) && data_pin() >= 0; }

// Periods of SCL: (Nlow + Nhigh) * (CLKDIV + 1) + 4 cycles of HFPERCLK each (16.3.3).
int64_t I2c::bit(int64_t count) const {
    const int64_t cycles =
        HIGH_AND_LOW[take(reg(CTRL), CTRL_CLHR)] * ((int64_t)reg(CLKDIV) + 1) + 4;
    return part.unit_rate(instance).span(cycles * count);
}

// -- registers --

uint32_t I2c::peek(uint32_t offset) const {
    if (offset == RXDATA || offset == RXDATAP)
        return received;
    return Peripheral::peek(offset);
}

uint32_t I2c::read(uint32_t offset) {
    if (offset != RXDATA)
        return peek(offset);
    if (!receive_full) {
        raise(IF_RXUF);
        return received;
    }
    const uint32_t data = received;
    receive_full = false;
    deliver();
    proceed();
    proceed_slave();
    follow();
    return data;
}

void I2c::write(uint32_t offset, uint32_t value) {
    if (offset == CMD)
        return command(value);
    if (offset == TXDATA) {
        if (transmit_full)
            return raise(IF_TXOF);
        transmit = (uint8_t)value;
        transmit_full = true;
        reg(STATUS) &= ~STATUS_TXC;
    } else {
        const bool enabled = reg(CTRL) & CTRL_EN;
        Peripheral::write(offset, value);
        if (offset == CTRL && !(reg(CTRL) & CTRL_EN) && enabled) {
            end_master();  // disabled: the bus is let go
            slave = Slave::IDLE;
            shift_full = false;
            busy = true;
        }
        if (offset == CTRL)
            watch_idle();
    }
    proceed();
    proceed_slave();
    follow();
}

void I2c::command(uint32_t value) {
    if (value & CMD_CLEARTX)
        transmit_full = false;
    if (value & CMD_CLEARPC)
        reg(STATUS) &= ~(STATUS_PSTART | STATUS_PSTOP | STATUS_PACK | STATUS_PNACK | STATUS_PCONT);
    // The pending bits have the order of the commands.
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
    proceed();
    proceed_slave();
    follow();
}

bool I2c::take_pending(uint32_t command) {
    const bool was = reg(STATUS) & command;
    reg(STATUS) &= ~command;
    return was;
}

void I2c::clocks_changed() {
    proceed();
    proceed_slave();
    follow();
}

// -- master --

void I2c::after(int64_t bit_count, Master next) {
    master = next;
    hold(false);
    part.schedule(bits, part.now() + bit(bit_count));
}

// Goes on from where the bus is held, as far as commands and data allow (16.3.5).
void I2c::proceed() {
    if (!usable() || !part.unit_rate(instance).runs())
        return;
    if (master != Master::IDLE && bits.pending())
        return;
    switch (master) {
    case Master::IDLE:
        if (!busy && slave == Slave::IDLE && take_pending(STATUS_PSTART))
            begin();
        else if (!busy)
            reg(STATUS) &= ~STATUS_PSTOP;
        return;
    case Master::ADDRESS:
        if (transmit_full)
            send_byte();
        else if (take_pending(STATUS_PSTOP))
            stop();
        else
            hold(true);
        return;
    case Master::ACKED:
    case Master::REFUSED:
        if (master == Master::ACKED && to_read)
            return request_byte(false);
        if (take_pending(STATUS_PSTART))
            begin();
        else if (transmit_full && master == Master::ACKED)
            send_byte();
        else if (take_pending(STATUS_PSTOP) ||
                 (master == Master::ACKED && reg(CTRL) & CTRL_AUTOSE))
            stop();
        else
            hold(true);
        return;
    case Master::NACKED:
        if (take_pending(STATUS_PSTART))
            begin();
        else if (take_pending(STATUS_PSTOP) || reg(CTRL) & CTRL_AUTOSN)
            stop();
        else if (take_pending(STATUS_PCONT)) {
            master = Master::ACKED;
            proceed();
        } else
            hold(true);
        return;
    case Master::RECEIVED:
        deliver();
        if (shift_full)
            return hold(true);
        if (take_pending(STATUS_PNACK)) {
            refused = true;
            after(1, Master::ACKNOWLEDGING);
        } else if (take_pending(STATUS_PACK) || reg(CTRL) & CTRL_AUTOACK) {
            refused = false;
            after(1, Master::ACKNOWLEDGING);
        } else
            hold(true);
        return;
    default:
        return;
    }
}

void I2c::begin() {
    if (master != Master::IDLE)
        reg(IF) |= IF_RSTART;
    busy = true;
    part.cancel(idle_timeout);
    after(1, Master::START);
}

void I2c::send_byte() {
    shift = transmit;
    transmit_full = false;
    addressing = master == Master::ADDRESS;
    after(8, Master::BITS);
}

void I2c::request_byte(bool acknowledged_last) {
    master = Master::READING;
    hold(false);
    part.send(Kind::I2C_READ, instance.index | data_pin() << 8, 0, acknowledged_last);
    const int cycles = LOW_CYCLES[take(reg(CTRL), CTRL_CLTO)];
    if (cycles)
        part.schedule(low_timeout, part.now() + part.unit_rate(instance).span(
                                                    cycles * ((int64_t)reg(CLKDIV) + 1)));
}

void I2c::stop() { after(1, Master::STOP); }

void I2c::on_bits(int64_t) {
    const int unit = instance.index | (data_pin() < 0 ? 0 : data_pin()) << 8;
    switch (master) {
    case Master::START:
        reg(IF) |= IF_START;
        master = Master::ADDRESS;
        break;
    case Master::BITS:
        if (addressing)
            to_read = shift & 1;
        master = Master::ASKED;
        part.send(addressing ? Kind::I2C_START : Kind::I2C_WRITE, unit, shift);
        break;
    case Master::ACKNOWLEDGING:  // of a received byte
        if (refused)
            master = Master::REFUSED;
        else
            request_byte(true);
        break;
    case Master::RECEIVING:
        shift_full = true;
        master = Master::RECEIVED;
        break;
    case Master::STOP:
        master = Master::IDLE;
        busy = false;
        reg(IF) |= IF_MSTOP;
        part.send(Kind::I2C_STOP, unit, 0);
        break;
    case Master::ACKED:
    case Master::NACKED:
        reg(IF) |= refused ? IF_NACK : IF_ACK;
        if (!transmit_full) {
            reg(STATUS) |= STATUS_TXC;
            reg(IF) |= IF_TXC;
        }
        break;
    default:
        break;
    }
    proceed();
    follow();
}

void I2c::answer(int acknowledged, uint32_t data) {
    part.cancel(low_timeout);
    if (acknowledged == ARBITRATION_LOST || acknowledged == BUS_ERROR) {
        if (master == Master::IDLE)
            return;
        part.cancel(bits);
        master = Master::IDLE;
        hold(false);
        busy = acknowledged == ARBITRATION_LOST;
        reg(IF) |= acknowledged == BUS_ERROR ? IF_BUSERR : IF_ARBLOST;
    } else if (master == Master::ASKED) {
        refused = !acknowledged;
        after(1, acknowledged ? Master::ACKED : Master::NACKED);
    } else if (master == Master::READING) {
        shift = (uint8_t)data;
        after(8, Master::RECEIVING);
    }
    follow();
}

// The master lets the bus go at once.
void I2c::end_master() {
    if (master != Master::IDLE)
        part.send(Kind::I2C_STOP, instance.index | (data_pin() < 0 ? 0 : data_pin()) << 8, 0);
    master = Master::IDLE;
    part.cancel(bits);
    part.cancel(low_timeout);
    hold(false);
}

// -- slave --

int I2c::slave_start(uint32_t address) {
    const bool repeated = busy && slave != Slave::IDLE;
    if (slave == Slave::READ && !first_read)
        reg(IF) |= IF_NACK;
    busy = true;
    part.cancel(idle_timeout);
    slave = Slave::IDLE;
    slave_answer = 0;
    if (!usable() || !(reg(CTRL) & CTRL_SLAVE)) {
        follow();
        return 0;
    }
    if (repeated)
        reg(IF) |= IF_RSTART;
    const bool own = !((address ^ reg(SADDR)) & reg(SADDRMASK) & 0xFE);
    const bool general = !address && reg(CTRL) & CTRL_GCAMEN;
    if (own || general) {
        reg(IF) |= IF_ADDR;
        shift = (uint8_t)address;
        shift_full = true;
        first_read = true;
        slave = Slave::ADDRESS;
        deliver();
        slave_answer = decide();
    }
    follow();
    return slave_answer;
}

int I2c::slave_write(uint32_t byte) {
    if (slave != Slave::WRITE)
        return slave_answer = 0;
    shift = (uint8_t)byte;
    shift_full = true;
    slave = Slave::WRITTEN;
    deliver();
    slave_answer = decide();
    follow();
    return slave_answer;
}

int I2c::slave_read(bool acknowledged) {
    if (slave != Slave::READ)
        return slave_answer = 0xFF;
    if (!first_read)
        reg(IF) |= acknowledged ? IF_ACK : IF_NACK;
    if (!first_read && !acknowledged) {
        slave = Slave::IDLE;
        slave_answer = 0xFF;
    } else {
        slave = Slave::LOAD;
        slave_answer = load();
    }
    follow();
    return slave_answer;
}

void I2c::slave_stop() {
    if (slave == Slave::READ && !first_read)
        reg(IF) |= IF_NACK;
    if (reg(CTRL) & CTRL_EN && reg(CTRL) & CTRL_SLAVE && usable())
        reg(IF) |= IF_SSTOP;
    slave = Slave::IDLE;
    shift_full = false;
    busy = false;
    slave_answer = 0;
    hold(false);
    proceed();
    follow();
}

// What was received goes into the buffer when there is room.
void I2c::deliver() {
    if (!shift_full || receive_full)
        return;
    received = shift;
    receive_full = true;
    shift_full = false;
}

// Whether what was received is acknowledged: by command, or by itself with AUTOACK.
int I2c::decide() {
    if (!part.unit_rate(instance).runs())  // asleep; the interrupt wakes it
        return WAITING;
    const bool wanted = reg(STATUS) & (STATUS_PACK | STATUS_PNACK) || reg(CTRL) & CTRL_AUTOACK;
    if (shift_full || !wanted) {
        hold(true);
        return WAITING;
    }
    hold(false);
    if (take_pending(STATUS_PNACK)) {
        slave = Slave::IDLE;
        return 0;
    }
    take_pending(STATUS_PACK);
    if (slave == Slave::ADDRESS)
        slave = shift & 1 ? Slave::READ : Slave::WRITE;
    else
        slave = Slave::WRITE;
    return 1;
}

int I2c::load() {
    if (!transmit_full || !part.unit_rate(instance).runs()) {
        hold(true);
        return WAITING;
    }
    hold(false);
    shift = transmit;
    transmit_full = false;
    first_read = false;
    slave = Slave::READ;
    return shift;
}

void I2c::proceed_slave() {
    if (slave_answer != WAITING)
        return;
    int now = WAITING;
    if (slave == Slave::ADDRESS || slave == Slave::WRITTEN) {
        deliver();
        now = decide();
    } else if (slave == Slave::LOAD)
        now = load();
    else
        now = 0;
    if (now != WAITING)
        release(now);
}

void I2c::release(int answer) {
    slave_answer = answer;
    hold(false);
    part.send(Kind::I2C_SLAVE, instance.index | (data_pin() < 0 ? 0 : data_pin()) << 8, answer);
}

// -- the bus held, idle, or low for too long --

void I2c::hold(bool on) {
    if (on && !holding) {
        reg(IF) |= IF_BUSHOLD;
        const int cycles = LOW_CYCLES[take(reg(CTRL), CTRL_CLTO)];
        const Rate rate = part.unit_rate(instance);
        if (cycles && rate.runs())
            part.schedule(low_timeout,
                          part.now() + rate.span(cycles * ((int64_t)reg(CLKDIV) + 1)));
    } else if (!on && holding)
        part.cancel(low_timeout);
    holding = on;
}

void I2c::on_low_timeout(int64_t) { raise(IF_CLTO); }

// Busy after enabling though nothing moves: BITO finds that out (16.3.11).
void I2c::watch_idle() {
    part.cancel(idle_timeout);
    const int cycles = IDLE_CYCLES[take(reg(CTRL), CTRL_BITO)];
    const Rate rate = part.unit_rate(instance);
    if (cycles && busy && master == Master::IDLE && slave == Slave::IDLE &&
        reg(CTRL) & CTRL_EN && rate.runs())
        part.schedule(idle_timeout, part.now() + rate.span(cycles * ((int64_t)reg(CLKDIV) + 1)));
}

void I2c::on_idle_timeout(int64_t) {
    if (reg(CTRL) & CTRL_GIBITO) {
        busy = false;
        proceed();
    }
    reg(IF) |= IF_BITO;
    follow();
}

// -- what the registers show --

void I2c::follow() {
    uint32_t phase = IDLE;
    bool transmitter = false, nacked = false;
    switch (master) {
    case Master::IDLE:
        break;
    case Master::START:
    case Master::ADDRESS:
        phase = START_SENT;
        transmitter = true;
        break;
    case Master::BITS:
    case Master::ASKED:
        phase = addressing ? ADDR : DATA;
        transmitter = true;
        break;
    case Master::ACKED:
    case Master::NACKED:
        phase = addressing ? ADDRACK : DATAACK;
        transmitter = !to_read;
        nacked = refused;
        break;
    case Master::READING:
    case Master::RECEIVING:
    case Master::RECEIVED:
        phase = DATA;
        break;
    case Master::ACKNOWLEDGING:
    case Master::REFUSED:
    case Master::STOP:
        phase = DATAACK;
        nacked = refused;
        break;
    }
    switch (slave) {
    case Slave::IDLE:
        break;
    case Slave::ADDRESS:
        phase = ADDR;
        transmitter = shift & 1;
        break;
    case Slave::WRITE:
    case Slave::WRITTEN:
        phase = DATA;
        break;
    case Slave::READ:
    case Slave::LOAD:
        phase = first_read ? ADDRACK : DATAACK;
        transmitter = true;
        break;
    }
    if (master == Master::IDLE && slave == Slave::IDLE && reg(STATUS) & STATUS_PSTART)
        phase = WAIT;
    reg(STATE) = (busy ? STATE_BUSY : 0) | (master != Master::IDLE ? STATE_MASTER : 0) |
                 (transmitter ? STATE_TRANSMITTER : 0) | (nacked ? STATE_NACKED : 0) |
                 (holding ? STATE_BUSHOLD : 0) | give(phase, STATE_STATE);
    uint32_t &status = reg(STATUS), &flags = reg(IF);
    const auto set = [](uint32_t &word, uint32_t bit, bool on) { word = on ? word | bit : word & ~bit; };
    set(status, STATUS_TXBL, !transmit_full);
    set(flags, IF_TXBL, !transmit_full);
    set(status, STATUS_RXDATAV, receive_full);
    set(flags, IF_RXDATAV, receive_full);
    part.dma->request(source, 0, receive_full);
    part.dma->request(source, 1, !transmit_full);
    update_interrupts();
}

}  // namespace efm32gg
