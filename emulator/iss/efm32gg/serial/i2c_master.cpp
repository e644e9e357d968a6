// The I2C master: from START to STOP, as commands and data allow. Chapter 16.3.5.
#include "efm32gg/serial/i2c.h"

namespace efm32gg {

using namespace i2c;

void I2c::after(int64_t bit_count, Master next) {
    master = next;
    hold(false);
    part.schedule_after(bits, bit(bit_count));
}

// Continues from a held bus as far as commands and data allow (16.3.5).
void I2c::proceed() {
    if (!usable() || !clock_now().runs()) return;
    if (master != Master::IDLE && bits.pending()) return;
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
    case Master::ACKED: case Master::REFUSED:
        if (master == Master::ACKED && to_read) return request_byte(false);
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
        } else {
            hold(true);
        }
        return;
    case Master::RECEIVED:
        deliver();
        if (shift_full) return hold(true);
        refused = take_pending(STATUS_PNACK);
        if (refused || take_pending(STATUS_PACK) || reg(CTRL) & CTRL_AUTOACK)
            after(1, Master::ACKNOWLEDGING);
        else
            hold(true);
        return;
    default: return;
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
    part.send(Kind::I2C_READ, unit(), 0, acknowledged_last);
    watch_low();
}

void I2c::stop() { after(1, Master::STOP); }

void I2c::on_bits(int64_t) {
    switch (master) {
    case Master::START:
        reg(IF) |= IF_START;
        master = Master::ADDRESS;
        break;
    case Master::BITS:
        if (addressing)
            to_read = shift & 1;
        master = Master::ASKED;
        part.send(addressing ? Kind::I2C_START : Kind::I2C_WRITE, unit(), shift);
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
        part.send(Kind::I2C_STOP, unit(), 0);
        break;
    case Master::ACKED: case Master::NACKED:
        reg(IF) |= refused ? IF_NACK : IF_ACK;
        if (!transmit_full) {
            reg(STATUS) |= STATUS_TXC;
            reg(IF) |= IF_TXC;
        }
        break;
    default: break;
    }
    proceed();
    follow();
}

void I2c::answer(int acknowledged, uint32_t data) {
    part.cancel(low_timeout);
    if (acknowledged == ARBITRATION_LOST || acknowledged == BUS_ERROR) {
        if (master == Master::IDLE) return;
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

// Releases the bus at once.
void I2c::end_master() {
    if (master != Master::IDLE)
        part.send(Kind::I2C_STOP, unit(), 0);
    master = Master::IDLE;
    part.cancel(bits);
    part.cancel(low_timeout);
    hold(false);
}

}  // namespace efm32gg
