// The asynchronous SRAM with checks of its timing: a fast version of emulator/rtl/sram.py, which
// documents it. A test drives both with the same pins.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

// Fields in the order of SramTiming, in ps.
struct SramTiming {
    int64_t access, output_enable, output_disable, write_pulse, data_setup;
};

// In the order of RULES.
enum ViolationKind : int64_t {
    SHORT_WRITE_PULSE, ADDRESS_CHANGED_DURING_WRITE, DATA_SETUP, READ_ACCESS,
    BUS_CONTENTION, TURNAROUND, WIRE_CONTENTION, VIOLATION_KINDS,
};

struct Violation {
    int64_t kind, time, address, found, needed;
    int64_t where;  // number of the memory
};

// Violations of all memories of an engine, ordered by time.
class ViolationLog {
public:
    // Stores the first `keep` of each kind.
    explicit ViolationLog(int64_t keep) : keep(keep) {}

    std::vector<Violation> kept;
    int64_t counts[VIOLATION_KINDS] = {};

    void add(const Violation &violation) {
        counts[violation.kind]++;
        if (counts[violation.kind] <= keep)
            kept.push_back(violation);
    }

private:
    const int64_t keep;
};

// Settled levels of the memory's pins. Packed in one word: with a structure of small fields,
// written one by one and copied as a whole, the processor would stall in every half clock.
class SramPins {
public:
    SramPins() : SramPins(0, true, true, true, false, 0) {}
    // Levels of 0 or 1; `driven`: the FPGA drives the data bus, with `data`.
    SramPins(uint32_t address, uint32_t ce_n, uint32_t oe_n, uint32_t we_n, uint32_t driven,
             uint32_t data)
        : word((uint64_t)address << 16 | (data & (0u - driven)) << 8 | driven << 3 | ce_n << 2 |
               oe_n << 1 | we_n << 0) {}

    uint32_t address() const { return (uint32_t)(word >> 16); }
    uint8_t data() const { return (uint8_t)(word >> 8); }  // 0 when not driven
    bool driven() const { return word & 8; }
    bool selected() const { return !(word & 4); }
    bool writes() const { return (word & 5) == 0; }
    bool reads() const { return (word & 7) == 1; }
    bool same_data(const SramPins &other) const { return ((word ^ other.word) & 0xFF08) == 0; }
    bool operator==(const SramPins &other) const { return word == other.word; }

private:
    uint64_t word;
};

class Sram {
public:
    // `number` identifies the memory in violations.
    Sram(uint8_t *memory, const SramTiming &timing, ViolationLog &log, int64_t number)
        : memory(memory), timing(timing), log(log), number(number) { power(true); }

    uint8_t bus() const { return pins.reads() ? memory[pins.address()] : pins.data(); }

    bool writes() const { return pins.writes(); }

    bool reads() const { return pins.reads(); }

    // Without supply it ignores writes, returns 0 and reports no violations.
    void power(bool on) {
        powered = on;
        pins = SramPins();
        write_since = data_since = address_since = selected_since = LONG_AGO;
        reads_since = released_at = LONG_AGO;
    }

    // Returns whether a pin changed.
    bool drive(int64_t time, SramPins next) {
        if (next == pins || !powered)
            return false;
        const SramPins old = pins;
        pins = next;
        const bool moved = pins.address() != old.address();
        if (old.writes() && (moved || !pins.writes())) {
            if (pins.writes())
                report(ADDRESS_CHANGED_DURING_WRITE, time, old.address(), time - write_since, 0);
            end_write(time, old);
        }
        if (pins.writes() && (moved || !old.writes()))
            write_since = time;
        check_bus(time, old);
        if (moved)
            address_since = time;
        if (pins.selected() && !old.selected())
            selected_since = time;
        if (!pins.same_data(old))
            data_since = time;
        return true;
    }

    // Whether clocks from `time` on, each low for `low` of `period`, can store a byte each at
    // consecutive addresses without a violation.
    bool stores_at(int64_t time, int64_t low, int64_t period) const {
        return powered && pins.writes() && pins.driven() && pins.selected() &&
               low >= timing.write_pulse && time - write_since >= timing.write_pulse &&
               period >= timing.data_setup && time - data_since >= timing.data_setup;
    }

    // Performs `count` such clocks, the last of which rises at `rose` and falls at `fell`. Stores
    // the byte on the lines and all of `next` except its last byte, which is then on the lines.
    void store(const uint8_t *next, int64_t count, int64_t rose, int64_t fell) {
        uint8_t *const to = memory + pins.address();
        *to = pins.data();
        std::copy(next, next + count - 1, to + 1);
        pins = SramPins(pins.address() + (uint32_t)count, false, true, false, true, next[count - 1]);
        address_since = data_since = rose;
        write_since = fell;
    }

    // Whether clocks from `time` on can read a byte each from consecutive addresses.
    bool offers_at(int64_t time, int64_t period) const {
        return powered && pins.reads() && !pins.driven() && period >= timing.access &&
               time - address_since >= timing.access && time - selected_since >= timing.access &&
               time - reads_since >= timing.output_enable;
    }

    // Performs `count` such clocks, the last of which rises at `rose`.
    void offer(uint8_t *out, int64_t count, int64_t rose) {
        std::copy(memory + pins.address(), memory + pins.address() + count, out);
        pins = SramPins(pins.address() + (uint32_t)count, false, false, true, false, 0);
        address_since = rose;
    }

    // The FPGA samples the bus at `time`.
    void sample(int64_t time) {
        if (!pins.reads())
            return;
        if (time - address_since < timing.access)
            report(READ_ACCESS, time, pins.address(), time - address_since, timing.access);
        else if (time - selected_since < timing.access)
            report(READ_ACCESS, time, pins.address(), time - selected_since, timing.access);
        else if (time - reads_since < timing.output_enable)
            report(READ_ACCESS, time, pins.address(), time - reads_since, timing.output_enable);
    }

private:
    static constexpr int64_t LONG_AGO = -1'000'000'000'000;

    uint8_t *const memory;
    const SramTiming timing;
    ViolationLog &log;
    const int64_t number;
    bool powered;
    SramPins pins;
    int64_t write_since, data_since, address_since, selected_since, reads_since, released_at;

    void end_write(int64_t time, const SramPins &old) {
        const int64_t width = time - write_since;
        if (width < timing.write_pulse)
            report(SHORT_WRITE_PULSE, time, old.address(), width, timing.write_pulse);
        const int64_t setup = old.driven() ? time - data_since : 0;
        if (setup < timing.data_setup)
            report(DATA_SETUP, time, old.address(), setup, timing.data_setup);
        memory[old.address()] = old.data();
    }

    void check_bus(int64_t time, const SramPins &old) {
        if (pins.reads() && !old.reads())
            reads_since = time;
        if (old.reads() && !pins.reads())
            released_at = time;
        if (pins.driven() && pins.reads() && !(old.driven() && old.reads()))
            report(BUS_CONTENTION, time, pins.address(), 0, 0);
        const int64_t free_for = time - released_at;
        if (pins.driven() && !old.driven() && !pins.reads() && free_for < timing.output_disable)
            report(TURNAROUND, time, pins.address(), free_for, timing.output_disable);
    }

    void report(ViolationKind kind, int64_t time, uint32_t address, int64_t found, int64_t needed) {
        log.add({kind, time, address, found, needed, number});
    }
};
