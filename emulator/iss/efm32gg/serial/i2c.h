// I2C, master and slave. EFM32GG Reference Manual, chapter 16.
//
// As master it sends a message for each start, byte and stop, and holds the bus until `answer`
// delivers the reply. As slave it is called by the slave_ functions; WAITING means that it holds
// the clock low until firmware has served it, and the answer follows by the outbox.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class I2c : public Peripheral {
public:
    static constexpr int WAITING = -1;
    static constexpr int ARBITRATION_LOST = -1, BUS_ERROR = -2;

    // `source`: of its DMA requests; `signals`: of its SDA pin, the SCL pin's follows.
    I2c(Part &part, const Instance &instance, int source, int signals)
        : Peripheral(part, instance), source(source), signals(signals) {}

    void reset() override;
    uint32_t read(uint32_t offset) override;
    void write(uint32_t offset, uint32_t value) override;
    uint32_t peek(uint32_t offset) const override;
    void clocks_changed() override { proceed_all(); }

    // Reply to the master's start, byte or read; `acknowledged` may be one of the errors above.
    void answer(int acknowledged, uint32_t data);

    // A transfer by another master. They return 1 if acknowledged, else 0; a read returns the byte;
    // or WAITING.
    int slave_start(uint32_t address);
    int slave_write(uint32_t byte);
    int slave_read(bool acknowledged);
    void slave_stop();
    int slave_poll() const { return slave_answer; }

    // The port pin of its SDA if both lines are routed; else -1.
    int data_pin() const;

private:
    enum class Master { IDLE, START, ADDRESS, BITS, ASKED, ACKED, NACKED, READING, RECEIVING,
                        RECEIVED, ACKNOWLEDGING, REFUSED, STOP };
    enum class Slave { IDLE, ADDRESS, WRITE, WRITTEN, READ, LOAD };

    const int source, signals;
    Master master = Master::IDLE;
    Slave slave = Slave::IDLE;
    bool busy = true;          // the bus is in use
    bool to_read = false;      // direction of the master's transfer
    bool addressing = false;   // the byte in the shift register is an address
    bool refused = false;      // the last byte was not acknowledged
    bool first_read = false;   // the slave has not sent a byte yet
    bool transmit_full = false, receive_full = false, shift_full = false, holding = false;
    uint8_t transmit = 0, received = 0, shift = 0;
    int slave_answer = 0;
    Event bits = Event::of<&I2c::on_bits>(this);
    Event idle_timeout = Event::of<&I2c::on_idle_timeout>(this);
    Event low_timeout = Event::of<&I2c::on_low_timeout>(this);

    bool usable() const;
    int unit() const;    // number and SDA pin, as in messages
    int64_t bit(int64_t count) const;
    void after(int64_t bit_count, Master next);
    void command(uint32_t value);
    bool take_pending(uint32_t command);
    void proceed_all();
    void proceed();
    void begin();
    void send_byte();
    void request_byte(bool acknowledged_last);
    void stop();
    void on_bits(int64_t time);
    void end_master();
    void deliver();
    int decide();
    int load();
    void release(int answer);
    void proceed_slave();
    void hold(bool on);
    void on_idle_timeout(int64_t time);
    void on_low_timeout(int64_t time);
    void watch_idle();
    void watch_low();
    void follow();
};

}  // namespace efm32gg
