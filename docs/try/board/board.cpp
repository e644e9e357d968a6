// CubeStar's board without Python: the FPGA, the processor with an image, the image sensor, the
// supplies and the satellite's serial line, in virtual time. It does what
// emulator/boards/cubestar/firmware.py and emulator/sim/firmware_processor.py do, in the same
// order at the same picosecond. Times are picoseconds, except where milliseconds are named.

#include "fpga_link.h"  // first: macros of the design have names of its constants

#include "fpga.h"

struct IssMachine;

extern "C" {
IssMachine *iss_new(uint8_t *, int64_t, uint8_t *, int64_t, uint8_t *, int64_t, uint8_t *,
                    const double *, int32_t, int64_t);
void iss_reset(IssMachine *, int32_t);
int32_t iss_run(IssMachine *, int64_t, int64_t *);
int64_t iss_take(IssMachine *, efm32gg::Outgoing *, int64_t);
void iss_uart_receive(IssMachine *, int32_t, uint32_t, uint32_t);
void iss_i2c_answer(IssMachine *, int32_t, int32_t, int32_t);
void iss_analog_changed(IssMachine *);
void iss_fpga(IssMachine *, const FpgaDriver *, const FpgaWire *, int32_t);
void iss_fpga_running(IssMachine *, uint32_t);
}

namespace board {

using efm32gg::Kind;
using efm32gg::Outgoing;

constexpr int64_t MILLISECOND = 1'000'000'000;
constexpr int FLOATING = 0xFF;  // a byte read from I2C lines that nobody pulls low

struct Board {
    uint8_t flash[FLASH_BYTES] = {}, ram[RAM_BYTES] = {}, external[EXTERNAL_RAM_BYTES] = {};
    uint8_t information[INFORMATION_BYTES] = {};
    double analog[ANALOG_INPUTS] = {};
    ImageSensor camera;
    Fpga fpga{camera};
    IssMachine *machine = nullptr;
    std::deque<uint8_t> incoming;  // from the host
    std::vector<uint8_t> sent;     // to the host, with their times
    std::vector<double> sent_ms;

    // Starts the program in `flash`.
    void power_up() {
        std::fill(std::begin(information), std::end(information), 0xFF);
        scramble(ram, RAM_BYTES);
        scramble(external, EXTERNAL_RAM_BYTES);
        scramble(fpga.memory, SRAM_BYTES);
        camera.on_change = [this] {
            fpga.stream_changed();
            measure();
        };
        set_analog();
        machine = iss_new(flash, FLASH_BYTES, ram, RAM_BYTES, external, EXTERNAL_RAM_BYTES,
                          information, analog, 0, 0);
        iss_reset(machine, 1);
        while (iss_take(machine, out, OUTGOING) == OUTGOING) {}
        const FpgaDriver functions = {
            fpga.driver, (decltype(FpgaDriver::set))driver_set,
            (decltype(FpgaDriver::get))driver_get, (decltype(FpgaDriver::burst))driver_burst,
            attend, nullptr, nullptr, nullptr};
        FpgaWire wires[] = {WIRES};
        for (FpgaWire &wire : wires) wire.pin = driver_pin(WIRE_NAMES[&wire - wires]);
        iss_fpga(machine, &functions, wires, sizeof wires / sizeof *wires);
    }

    void host_writes(uint8_t byte) {
        if (incoming.empty()) arrival = host_time + CHARACTER;
        incoming.push_back(byte);
    }

    void run(int64_t until) {
        while (now < until) {
            while (!incoming.empty() && arrival <= now) deliver();
            const int64_t limit =
                std::min({until, now + LOOK_AHEAD, incoming.empty() ? until : arrival});
            const uint32_t running = fpga.running();
            if (running || reported) iss_fpga_running(machine, running);
            reported = running;
            int64_t reached;
            iss_run(machine, limit, &reached);
            while (const int64_t count = iss_take(machine, out, OUTGOING))
                for (int64_t n = 0; n < count; n++) {
                    while (!incoming.empty() && arrival <= out[n].time) deliver();
                    now = std::max(now, out[n].time);
                    fpga.run(now);
                    handle(out[n]);
                }
            fpga.run(reached);
            now = std::max(now, reached);
        }
        while (!incoming.empty() && arrival <= until) deliver();
        host_time = until;
    }

private:
    static constexpr int64_t OUTGOING = 64;
    Outgoing out[OUTGOING];
    int64_t now = 0, host_time = 0;
    int64_t arrival = 0;     // of the first incoming byte
    int64_t line_until = 0;  // the end of the last byte to the host
    int64_t reported = -1;   // running cameras that the machine knows
    bool memory_on = true, imager_on = true, enable = false, rnw = false;
    uint32_t noise = 1;
    int camera_address = 0;
    bool writing = false;
    std::vector<uint8_t> message;  // to the camera

    static uint32_t attend(int64_t reached, int32_t end, int32_t, int64_t until);

    void deliver() {
        iss_uart_receive(machine, 0x100 | UART_RX, incoming.front(), BAUD << 8);
        incoming.pop_front();
        arrival += CHARACTER;
    }

    void handle(const Outgoing &one) {
        switch (one.kind) {
        case Kind::UART:
            if (one.unit >> 8 != UART_TX) return;
            line_until = std::max(now, line_until) + CHARACTER;
            sent.push_back((uint8_t)one.value);
            sent_ms.push_back((double)line_until / MILLISECOND);
            return;
        case Kind::PIN: return pin(one);
        case Kind::I2C_START:
        case Kind::I2C_WRITE:
        case Kind::I2C_READ:
        case Kind::I2C_STOP: return i2c(one);
        default: return;
        }
    }

    // Level -1: the pin floats, and a resistor defines its level.
    void pin(const Outgoing &one) {
        const bool pulled_down = one.value > 0, pulled_up = one.value != 0;
        switch (one.unit) {
        case PIN_ENABLE: fpga.set(driver_pin("ENABLE"), enable = pulled_down); break;
        case PIN_RNW: fpga.set(driver_pin("RNW"), rnw = pulled_down); break;
        case PIN_BANK: fpga.set(driver_pin("BANK"), pulled_down); break;
        case PIN_CAMERA_RESET: camera.reset_pin(pulled_up, one.time); break;
        case PIN_MEMORY_SWITCH:
            memory_on = pulled_up;
            if (!memory_on) scramble(external, EXTERNAL_RAM_BYTES);
            break;
        case PIN_IMAGER_SWITCH:
            imager_on = pulled_up;
            measure();
            camera.power(imager_on, fpga.now);
            if (!imager_on) scramble(fpga.memory, SRAM_BYTES);
            break;
        }
        measure();
    }

    // What a memory contains after power-up.
    void scramble(uint8_t *memory, uint32_t bytes) {
        for (uint32_t n = 0; n < bytes; n++)
            memory[n] = (uint8_t)((noise = noise * 1664525 + 1013904223) >> 24);
    }

    // The camera's control bus; nobody answers on any other pins.
    void i2c(const Outgoing &one) {
        const int unit = one.unit & 0xFF;
        const bool asks = one.kind != Kind::I2C_STOP;
        if (one.unit >> 8 != CAMERA_SDA) {
            if (asks) iss_i2c_answer(machine, unit, false, FLOATING);
            return;
        }
        const auto finish = [this, time = one.time] {
            if (writing) {
                writing = false;
                if (camera.answers(camera_address)) camera.write(message, time);
            }
        };
        if (one.kind == Kind::I2C_STOP) return finish();
        bool acknowledged = true;
        int data = 0;
        if (one.kind == Kind::I2C_START) {
            finish();
            camera_address = (int)one.value >> 1;
            acknowledged = camera.answers(camera_address);
            writing = acknowledged && !(one.value & 1);
            message.clear();
        } else if (one.kind == Kind::I2C_WRITE) {
            acknowledged = writing;
            if (writing) message.push_back((uint8_t)one.value);
        } else {
            data = camera.answers(camera_address) ? camera.read() : FLOATING;
        }
        iss_i2c_answer(machine, unit, acknowledged, data);
    }

    void measure() {
        if (set_analog()) iss_analog_changed(machine);
    }

    // Sets what the monitors of the supplies measure; returns whether anything changed.
    bool set_analog() {
        const double fpga_ma = !enable ? FPGA_STANDBY_MA : rnw ? FPGA_READING_MA : FPGA_STORING_MA;
        const double imager_ma = camera.enabled() ? IMAGER_ENABLED_MA : IMAGER_DISABLED_MA;
        const double memory_ma = enable && rnw ? MEMORY_TRANSFER_MA : MEMORY_STANDBY_MA;
        const double before[] = {analog[MEMORY_ADC], analog[IMAGER_ADC]};
        analog[TEMPERATURE] = CAMERA_TEMPERATURE_C, analog[SUPPLY] = SUPPLY_VOLTS;
        analog[MEMORY_ADC] = analog[MEMORY_COMPARATOR] =
            std::min((memory_on ? memory_ma : 0.0) / 1000 * MEMORY_VOLTS_PER_A, SUPPLY_VOLTS);
        analog[IMAGER_ADC] = analog[IMAGER_COMPARATOR] = std::min(
            (imager_on ? imager_ma + fpga_ma : 0.0) / 1000 * IMAGER_VOLTS_PER_A, SUPPLY_VOLTS);
        return before[0] != analog[MEMORY_ADC] || before[1] != analog[IMAGER_ADC];
    }
};

Board *const it = new Board;

uint32_t Board::attend(int64_t reached, int32_t end, int32_t, int64_t until) {
    return it->fpga.attend(reached, end, until);
}

}  // namespace board

#define EXPORT(name) extern "C" __attribute__((export_name(#name)))

// Memories that the page fills before `power_up`, or reads.
EXPORT(board_flash) uint8_t *board_flash() { return board::it->flash; }
EXPORT(board_sky) uint8_t *board_sky() { return board::it->fpga.sky; }
EXPORT(board_external) uint8_t *board_external() { return board::it->external; }

EXPORT(board_power_up) void board_power_up() { board::it->power_up(); }
EXPORT(board_write) void board_write(uint32_t byte) { board::it->host_writes((uint8_t)byte); }

// Runs up to a time since power-up. Returns the number of bytes sent to the host meanwhile.
EXPORT(board_run) uint32_t board_run(uint32_t until_ms) {
    board::it->sent.clear();
    board::it->sent_ms.clear();
    board::it->run(until_ms * board::MILLISECOND);
    return (uint32_t)board::it->sent.size();
}

EXPORT(board_sent) const uint8_t *board_sent() { return board::it->sent.data(); }
EXPORT(board_sent_ms) const double *board_sent_ms() { return board::it->sent_ms.data(); }
