// Who is at the part's pins and at its external bus in C++, so that nobody else has to be asked.
#pragma once

#include <cstdint>

namespace efm32gg {

class Outside {
public:
    static constexpr int PORTS = 6;

    virtual ~Outside() = default;

    // Pins whose level comes from here, and pins whose changes go here and not to the outbox.
    uint32_t senses[PORTS] = {}, drives[PORTS] = {};

    // Levels of `port` at `now`; only bits in `senses` count.
    virtual uint32_t sense(int port, int64_t now) = 0;

    // Outputs in `changed`, all in `drives`, have taken `levels` at `now`.
    virtual void drive(int port, uint32_t changed, uint32_t levels, int64_t now) = 0;

    // An access of a byte on the external bus, where there is no memory in the part's own arrays;
    // false where nothing answers.
    virtual bool external(int bank, uint32_t address, uint8_t &value, bool write, int64_t now) {
        (void)bank, (void)address, (void)value, (void)write, (void)now;
        return false;
    }

    // Nothing happens in the part before `until`, and it sleeps: returns when a level in `senses`
    // changes before that, else `until`.
    virtual int64_t sleep_until(int64_t now, int64_t until) {
        (void)now;
        return until;
    }
};

}  // namespace efm32gg
