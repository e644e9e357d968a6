// Stands in for the part while it is being written.
#pragma once
#include "efm32gg/outbox.h"
#include "armv7m/bus.h"
#include "armv7m/system.h"
#include "fpga_link.h"
namespace efm32gg {
enum class Clock { HFCORE };
struct Memories {
    uint8_t *flash, *ram, *information, *external;
    uint32_t flash_size, ram_size, external_size;
    const double *analog;
};
class Part : public armv7m::Bus, public armv7m::SystemListener {
public:
    Part(armv7m::Cpu &, const Memories &) {}
    static armv7m::SystemParameters system_parameters() { return {}; }
    bool read(uint32_t, uint32_t, uint32_t &) override { return false; }
    bool write(uint32_t, uint32_t, uint32_t) override { return false; }
    Outbox outbox;
    int mode = 0;
    uint32_t exits = 0;
    Outside *outside = nullptr;
    int64_t now() const { return 0; }
    int64_t next_event() const { return NEVER; }
    int64_t hertz(Clock) const { return 0; }
    void run(int64_t) {}
    void reset(uint32_t) {}
    void schedule(Event &, int64_t) {}
    void cancel(Event &) {}
    void pin(int, int, int) {}
    int pin_level(int, int) const { return 0; }
    void uart_receive(int, uint32_t, uint32_t) {}
    int i2c_slave_start(int, int) { return 0; }
    int i2c_slave_write(int, int) { return 0; }
    int i2c_slave_read(int) { return 0; }
    int i2c_slave_stop(int) { return 0; }
    int i2c_slave_poll(int) { return 0; }
    void i2c_answer(int, bool, int) {}
    void analog_changed() {}
};
}  // namespace efm32gg
