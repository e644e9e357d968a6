// What LESENSE does with results: the result buffer, and the decoder's state machine. EFM32GG
// Reference Manual, 25.3.6 and 25.3.7.
#pragma once

#include "efm32gg/part/peripheral.h"

namespace efm32gg {

// Sixteen entries in the unit's BUF registers, the oldest at RD.
class ResultBuffer {
public:
    static constexpr uint32_t ENTRIES = 16;

    void clear() { *this = {}; }
    uint32_t size() const { return count; }
    bool full() const { return count == ENTRIES; }
    uint32_t read_index() const { return reading; }
    uint32_t write_index() const { return (reading + count) % ENTRIES; }

    // Where the next entry goes; a full buffer drops its oldest one.
    uint32_t push() {
        const uint32_t place = write_index();
        if (full())
            reading = (reading + 1) % ENTRIES;
        else
            count++;
        return place;
    }

    void pop() {
        if (!count) return;
        reading = (reading + 1) % ENTRIES;
        count--;
    }

private:
    uint32_t reading = 0, count = 0;
};

// One step of the decoder.
struct Decision {
    bool found = false;        // a transition matched
    uint32_t from = 0;         // the state that the decoder left
    uint32_t transition = 0;   // its TCONF register
};

// The transition for the four `sensors` from `state`: that of TCONFA, then TCONFB, then, if A chains,
// those of the next state. A set bit in MASK ignores its sensor.
template <class Read> Decision decide(uint32_t state, uint32_t sensors, Read read) {
    using namespace lesense;
    uint32_t at = state;
    for (int n = 0; n < 16; n++) {
        const uint32_t a = read(ST0_TCONFA + 8 * at), b = read(ST0_TCONFB + 8 * at);
        for (const uint32_t one : {a, b}) {
            const uint32_t care = 0xF & ~field(one, ST0_TCONFA_MASK);
            if (((sensors ^ field(one, ST0_TCONFA_COMP)) & care) == 0) return {true, state, one};
        }
        if (!(a & ST0_TCONFA_CHAIN)) break;
        at = (at + 1) % 16;
    }
    return {false, state, 0};
}

}  // namespace efm32gg
