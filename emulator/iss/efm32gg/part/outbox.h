// Messages from the part. The part makes no callbacks: it appends to the outbox and, where the
// receiver must act at that picosecond, stops the core after the instruction.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstring>

namespace efm32gg {

enum class Kind : int32_t {
    PIN,          // unit: port * 16 + bit; value: level 0 or 1, -1: released; extra: drive
    UART,         // a character begins; unit: block and TX pin; value: its bits, 0x10000 for a
                  // break; extra: its duration in ps. See Part::uart_receive
    I2C_START,    // master; unit; value: address byte
    I2C_WRITE,    // master; value: byte
    I2C_READ,     // master requests a byte; extra: 1 if it acknowledged the previous one
    I2C_STOP,     // master
    I2C_SLAVE,    // value: answer of the slave
    ITM,          // unit: port; value; extra: size
    SEMIHOSTING,  // a call of the host, which must answer it; unit: operation; value: parameter
    LOG,          // text: something not modelled or used wrongly; each text once
    RESET,        // the part was reset; value: RMU's cause bits; text: an unexpected cause
    SLEEP,        // value: energy mode 1..4, 0: awake; extra: 1 for EM4 on the backup supply
    FLASH,        // value: address; unit 0: written, extra: bytes; 1: erased, extra: wear or bytes
    SPI,          // a word begins; unit; value: bits; extra: duration in ps
    FAULT,        // the program cannot continue; text
};

struct Outgoing {
    Kind kind;
    int32_t unit;
    int64_t value, extra, time;
    char text[96];
};
static_assert(sizeof(Outgoing) == 128, "the Python side reads it as 128 bytes");

class Outbox {
public:
    static constexpr int32_t CAPACITY = 1024;

    Outgoing items[CAPACITY];
    int32_t count = 0;
    int64_t lost = 0;

    Outgoing &add(Kind kind, int32_t unit, int64_t value, int64_t extra, int64_t time) {
        if (count == CAPACITY) {
            lost++;
            count--;
        }
        Outgoing &item = items[count++];
        item = {kind, unit, value, extra, time, {}};
        return item;
    }
};

}  // namespace efm32gg
