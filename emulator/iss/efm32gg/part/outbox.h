// What the part tells the world outside. The part never calls out for it: it appends to the outbox
// and, where the world has to act at that picosecond, asks the core to stop behind the instruction.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstring>

namespace efm32gg {

enum class Kind : int32_t {
    PIN,          // unit: port * 16 + bit; value: level 0 or 1, or -1: no longer driven; extra: drive
    UART,         // a character begins; unit: see Unit; value: its bits; extra: its duration in ps
    I2C_START,    // master; unit; value: address byte
    I2C_WRITE,    // master; value: byte
    I2C_READ,     // master wants a byte; extra: 1 if it acknowledged the one before
    I2C_STOP,     // master
    I2C_SLAVE,    // answer of the slave; value: what, extra: byte
    ITM,          // unit: port; value; extra: size
    SEMIHOSTING,  // text
    LOG,          // text: something not modelled, or used wrongly; each once
    RESET,        // the part was reset; value: RMU's cause bits; text: what the program did not
                  // want
    SLEEP,        // value: energy mode 1..4, 0: awake
    FLASH,        // value: address; extra: bytes written, or page size with unit 1: erased
    SUPPLY,       // value: state of clocks has changed (power)
    SPI,          // a word begins; unit; value: bits; extra: duration in ps
    FAULT,        // the core is locked up, or met what it can not go on with; text
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
