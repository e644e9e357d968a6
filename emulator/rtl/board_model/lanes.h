// Levels of many boards at once: bit n of a word belongs to board n, its lane.

#pragma once

#include <cstdint>

typedef uint64_t Bits;

constexpr int LANES = 64;
constexpr Bits none = 0, all = ~none;

// Calls `act` for each lane of `lanes`.
template <typename Act> void each(Bits lanes, Act act) {
    for (; lanes; lanes &= lanes - 1)
        act(__builtin_ctzll(lanes));
}

// A memory of each lane, with a write port and a registered read port on one clock. A read of the
// word that is written returns the old one.
template <int ADDRESS, int DATA> struct Memory {
    Bits write_address[ADDRESS] = {}, read_address[ADDRESS] = {}, input[DATA] = {};
    Bits write = 0, read = 0, output[DATA] = {};

    void fill(unsigned address, unsigned word) {
        for (auto &memory : words)
            memory[address] = (uint16_t)word;
    }

    // Returns the lanes whose content changes.
    Bits clock() {
        Bits moved = stale;
        for (int n = 0; n < ADDRESS; n++)
            moved |= read_address[n] ^ last[n];
        const Bits reading = read & moved;  // others would read the same word again
        each(reading, [&](int lane) {
            const unsigned word = words[lane][at(read_address, lane)];
            for (int n = 0; n < DATA; n++)
                output[n] = (output[n] & ~(Bits(1) << lane)) | Bits(word >> n & 1) << lane;
        });
        for (int n = 0; n < ADDRESS; n++)
            last[n] = (last[n] & ~reading) | (read_address[n] & reading);
        stale &= ~reading;
        Bits changed = 0;
        each(write, [&](int lane) {
            uint16_t &word = words[lane][at(write_address, lane)];
            const unsigned next = at(input, lane);
            changed |= Bits(word != next) << lane;
            word = (uint16_t)next;
        });
        stale |= changed;
        return changed;
    }

private:
    uint16_t words[LANES][1 << ADDRESS] = {};
    Bits last[ADDRESS] = {}, stale = all;

    template <int SIZE> static unsigned at(const Bits (&bits)[SIZE], int lane) {
        unsigned found = 0;
        for (int n = 0; n < SIZE; n++)
            found |= unsigned(bits[n] >> lane & 1) << n;
        return found;
    }
};
