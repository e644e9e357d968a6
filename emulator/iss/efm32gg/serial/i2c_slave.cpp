// The I2C slave: called by the bus, answers when firmware has served it. Chapter 16.3.6.
#include "efm32gg/serial/i2c.h"

namespace efm32gg {

using namespace i2c;

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
    if (slave != Slave::WRITE) return slave_answer = 0;
    shift = (uint8_t)byte;
    shift_full = true;
    slave = Slave::WRITTEN;
    deliver();
    slave_answer = decide();
    follow();
    return slave_answer;
}

int I2c::slave_read(bool acknowledged) {
    if (slave != Slave::READ) return slave_answer = 0xFF;
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

// Moves the received byte into the buffer if there is room.
void I2c::deliver() {
    if (!shift_full || receive_full) return;
    received = shift;
    receive_full = true;
    shift_full = false;
}

// Whether the received byte is acknowledged: by command, or automatically with AUTOACK.
int I2c::decide() {
    if (!clock_now().runs())  // asleep; the interrupt wakes it
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
    if (!transmit_full || !clock_now().runs()) {
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
    if (slave_answer != WAITING) return;
    int answer = 0;
    if (slave == Slave::ADDRESS || slave == Slave::WRITTEN) {
        deliver();
        answer = decide();
    } else if (slave == Slave::LOAD) {
        answer = load();
    }
    if (answer != WAITING)
        release(answer);
}

void I2c::release(int answer) {
    slave_answer = answer;
    hold(false);
    part.send(Kind::I2C_SLAVE, unit(), answer);
}

}  // namespace efm32gg
