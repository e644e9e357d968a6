// Drives a compiled FPGA with pixel clocks, data clocks and SRAMs. Each CompiledEngine owns one
// driver; contract.py documents the calls. pins_header.py generates pins.h from the wiring.

#include "reading.h"

namespace {

#ifdef BUS_HIGH
// Transactions, see external_bus.py; an event's cycle k is at
// start + floor(k * numerator / denominator).
struct Transactions {
    const int32_t *addresses;
    uint8_t *data;
    int64_t count, write, select, above;
    int64_t start, numerator, denominator, cycles;
    int64_t offsets[6];

    int64_t time(int64_t event) const {
        return start + (event / 6 * cycles + offsets[event % 6]) * numerator / denominator;
    }
};
#else
struct Transactions;
#endif

class Driver : public Reading {
public:
    using Reading::Reading;

#ifdef BUS_HIGH
    // Runs the events of `wanted` from number `event` on, and before each one the edges of the
    // cameras in the mask `running`. Returns the next event: if a camera's segment is over or an
    // acknowledge changed, the one that follows; at the end, the one after the last, and sets
    // `over`.
    __attribute__((flatten)) int64_t access(const Transactions &wanted, int64_t event,
                                            uint32_t running, int32_t &over) {
        int64_t reached;
        int32_t camera;
        for (; event < 6 * wanted.count; event++) {
            const int64_t time = wanted.time(event), index = event / 6;
            if (running && burst_on(top, time, running, reached, camera) != TIME_REACHED)
                return event;
            const uint32_t address = (uint32_t)wanted.addresses[index];
            switch (event % 6) {
            case 0:
                top.BUS_HIGH.set<uint8_t>(address >> 16 & 0xFF);
                top.BUS_LOW_I.set<uint8_t>(address >> 8 & 0xFF);
                top.BUS_LATCH.set<bool>(true);
                break;
            case 1:
                top.BUS_LATCH.set<bool>(false);
                break;
            case 2:
                top.BUS_HIGH.set<uint8_t>(address & 0xFF);
                if (wanted.write)
                    top.BUS_LOW_I.set<uint8_t>(wanted.data[index]);
                select(wanted.select, false);
                break;
            case 3:
                strobe_line(wanted.write, false);
                break;
            case 4:
                if (!wanted.write) {
                    wanted.data[index] = top.BUS_LOW_OE.get<bool>() ? top.BUS_LOW_O.get<uint8_t>()
                                                                     : top.BUS_LOW_I.get<uint8_t>();
                    sample(time);
                }
                strobe_line(wanted.write, true);
                break;
            case 5:
                select(wanted.select, true);
                break;
            }
            settle(time);
            if (event % 6 == 5 && !wanted.write && wanted.data[index] > wanted.above) {
                event++;
                break;
            }
        }
        over = true;
        return event;
    }
#endif

private:
#ifdef BUS_HIGH
    void select(int64_t number, bool level) {
#define SELECT(n, port) \
    if (number == n) \
        top.port.set<bool>(level);
        BUS_SELECTS
#undef SELECT
    }

    void strobe_line(bool write, bool level) {
        if (write)
            top.BUS_WRITE.set<bool>(level);
        else
            top.BUS_READ.set<bool>(level);
    }
#endif
};

}  // namespace

extern "C" {

Driver *driver_new(uint8_t *const *memories, const SramTiming *timing, int64_t keep,
                   int32_t skipping) {
    return new Driver(memories, *timing, keep, skipping != 0);
}

void driver_delete(Driver *driver) { delete driver; }

// Number of the pin `name`, -1 if there is none.
int32_t driver_pin(const char *name) {
    for (size_t i = 0; i < sizeof PIN_TABLE / sizeof *PIN_TABLE; i++)
        if (strcmp(PIN_TABLE[i].name, name) == 0)
            return (int32_t)i;
    return -1;
}

void driver_set(Driver *driver, int32_t pin, uint32_t value, int64_t now) {
    driver->set(pin, value, now);
}

uint32_t driver_get(const Driver *driver, int32_t pin) { return PIN_TABLE[pin].get(driver->top); }

// Drives `count` pins, each at its time, and writes the levels of `watched` after each to `out`.
void driver_replay(Driver *driver, int64_t count, const int64_t *times, const int32_t *pins,
                   const uint32_t *levels, int32_t watched, const int32_t *outputs, uint32_t *out) {
    for (int64_t n = 0; n < count; n++) {
        driver->set(pins[n], levels[n], times[n]);
        for (int32_t k = 0; k < watched; k++)
            *out++ = PIN_TABLE[outputs[k]].get(driver->top);
    }
}

// Name and width of register number `index`; null after the last one.
const char *driver_register(int32_t index, int32_t *bits) {
    if (index < 0 || index >= REGISTER_COUNT)
        return nullptr;
    *bits = REGISTER_TABLE[index].bits;
    return REGISTER_TABLE[index].name;
}

void driver_flip(Driver *driver, int32_t index, int32_t bit, int64_t now) {
    driver->flip(REGISTER_TABLE[index], bit, now);
}

void driver_use_strides(Driver *driver, int32_t on) { driver->strides = on != 0; }

int64_t driver_clocks_at_once(const Driver *driver) { return driver->clocks_at_once; }

// Writes the levels of all registers to `out`, unless null; returns the number of 32-bit words.
int64_t driver_state(const Driver *driver, uint32_t *out) {
    int64_t words = 0;
    for (int32_t index = 0; index < REGISTER_COUNT; index++) {
        const Register &one = REGISTER_TABLE[index];
        const uint32_t *levels = one.levels(driver->top);
        const int64_t count = (one.bits + 31) / 32;
        if (out)
            std::copy(levels, levels + count, out + words);
        words += count;
    }
    return words;
}

void driver_power(Driver *driver, int32_t memory, int32_t on, int64_t now) {
    driver->power(memory, on != 0, now);
}

void driver_load(Driver *driver, int32_t camera, const Segment *segment, int64_t edge,
                 int64_t now) {
    driver->load(camera, *segment, edge, now);
}

void driver_use_pixels(Driver *driver, int32_t camera, const uint8_t *pixels, int64_t now) {
    driver->use_pixels(camera, pixels, now);
}

int32_t driver_burst(Driver *driver, int64_t until, uint32_t running, int64_t *reached,
                     int32_t *camera) {
    return driver->burst(until, running, *reached, *camera);
}

// The half period is numerator / denominator, the first edge at start + offset / denominator.
void driver_strobe(Driver *driver, uint8_t *out, int64_t count, int64_t start, int64_t numerator,
                   int64_t denominator, int64_t offset) {
    driver->strobe(out, count, start, Steps(numerator, denominator, offset));
}

// See Driver::access; -1 for a design without an external bus.
int64_t driver_access(Driver *driver, const Transactions *wanted, int64_t event, uint32_t running,
                      int32_t *over) {
#ifdef BUS_HIGH
    return driver->access(*wanted, event, running, *over);
#else
    (void)driver, (void)wanted, (void)event, (void)running, (void)over;
    return -1;
#endif
}

// Number of violations stored; writes those from number `first` on to `out`, unless null.
// -1 once the design oscillates.
int64_t driver_violations(const Driver *driver, int64_t first, Violation *out) {
    if (driver->unsettled)
        return -1;
    const std::vector<Violation> &kept = driver->log.kept;
    if (out)
        std::copy(kept.begin() + first, kept.end(), out);
    return (int64_t)kept.size();
}

// Number of violations of one kind, including those not stored.
int64_t driver_violation_count(const Driver *driver, int32_t kind) {
    return driver->log.counts[kind];
}

}
