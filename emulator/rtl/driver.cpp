// Drives the compiled FPGA: pixel clock edges in, data clock cycles in, SRAM beside it.
// One of these is behind every CompiledEngine; stepping.py says what is asked of it and when.
//
// design.cpp is CXXRTL's output. Its eval() computes outputs and the registers' next values,
// commit() makes those current and tells whether any changed. Outputs lag a register change by
// one eval(), and an asynchronous reset takes one more, hence settle().

#include "design.cpp"
#include "sram_model.h"

#include <algorithm>
#include <cstring>
#include <vector>

namespace {

using Top = cxxrtl_design::p_top;

// The times of evenly spaced edges, one after the other without a division for each:
// value() = floor((numerator * k + offset) / denominator).
class Steps {
public:
    Steps(int64_t numerator, int64_t denominator, int64_t offset)
        : numerator(numerator), denominator(denominator), offset(offset),
          step(numerator / denominator), step_rest(numerator % denominator) { go_to(0); }

    int64_t value() const { return whole; }

    void go_to(int64_t k) {
        const __int128 product = (__int128)numerator * k + offset;
        whole = (int64_t)(product / denominator);
        rest = (int64_t)(product % denominator);
    }

    void next() {
        whole += step;
        rest += step_rest;
        if (rest >= denominator) {
            rest -= denominator;
            whole++;
        }
    }

    // Largest k whose value is at most `limit`.
    int64_t last_within(int64_t limit) const {
        return (int64_t)((((__int128)limit + 1) * denominator - 1 - offset) / numerator);
    }

private:
    int64_t numerator, denominator, offset;
    int64_t step, step_rest;
    int64_t whole, rest;
};

struct Pin {
    const char *name;
    void (*set)(Top &, uint32_t);
    uint32_t (*get)(const Top &);
};

#define GETTER(port) [](const Top &top) { return top.port.template get<uint32_t>(); }
#define INPUT(name, port) \
    {name, [](Top &top, uint32_t value) { top.port.template set<uint32_t>(value); }, GETTER(port)}
#define OUTPUT(name, port) {name, nullptr, GETTER(port)}

const Pin PINS[] = {
    INPUT("PIXCLK", p_PIXCLK),
    INPUT("PIXDATA", p_PIXDATA),
    INPUT("HSYNC", p_HSYNC),
    INPUT("VSYNC", p_VSYNC),
    INPUT("ENABLE", p_ENABLE),
    INPUT("RNW", p_RNW),
    INPUT("BANK", p_BANK),
    INPUT("DCLK", p_DCLK),
    OUTPUT("ACK", p_ACK),
    OUTPUT("DATA", p_DATA),
    OUTPUT("SRAM_A", p_SRAM__A),
    OUTPUT("SRAM_D_O", p_SRAM__D__O),
    OUTPUT("SRAM_D_OE", p_SRAM__D__OE),
    OUTPUT("SRAM_CE_N", p_SRAM__CE__N),
    OUTPUT("SRAM_OE_N", p_SRAM__OE__N),
    OUTPUT("SRAM_WE_N", p_SRAM__WE__N),
};

// A segment of the camera's stream as pixel_clock.py describes it; edge k is at
// start + floor(k * half_numerator / half_denominator).
struct Segment {
    int64_t start;
    int64_t half_numerator;
    int64_t half_denominator;
    int64_t edges;
    int64_t rows;
    int64_t line_clocks;
    int64_t active_columns;
    int64_t vsync;
};

// In the order of Outcome.
enum Outcome : int32_t { TIME_REACHED, ACK_REACHED, SEGMENT_OVER };

class Driver {
public:
    Driver(uint8_t *memory, const SramTiming &timing, int64_t keep, bool skipping)
        : sram(memory, timing, keep), skipping(skipping) { settle(0); }

    Top top;
    Sram sram;

    void set(const Pin &pin, uint32_t value, int64_t now) {
        if (strcmp(pin.name, "DCLK") == 0 && value && !top.p_DCLK.get<bool>())
            sram.sample(now);
        pin.set(top, value);
        settle(now);
    }

    void load(const Segment &next, int64_t next_edge) {
        segment = next;
        pixels = nullptr;
        edge = next_edge;
        times = Steps(segment.half_numerator, segment.half_denominator, 0);
        times.go_to(edge);
        top.p_VSYNC.set<bool>(segment.vsync);
        find_sample(edge / 2);
        put_sample();
    }

    void use_pixels(const uint8_t *rendered) {
        pixels = rendered;
        put_sample();
    }

    // Makes the segment's edges up to `until`, or up to the rising edge that brings ACK to
    // `stop_level` (-1: none); `reached` is the time when it returns.
    __attribute__((flatten)) Outcome burst(int64_t until, int32_t stop_level, int64_t &reached) {
        while (edge < segment.edges) {
            const int64_t time = segment.start + times.value();
            if (time > until) {
                reached = until;
                return TIME_REACHED;
            }
            reached = time;
            if (edge % 2 == 0) {
                const bool wrote = sram.writes();
                top.p_PIXCLK.set<bool>(true);
                const bool changed = settle(time);
                next_edge();
                if (skipping && !changed && !wrote && !top.p_HSYNC.get<bool>())
                    skip_low_samples(until);
                if (top.p_ACK.get<uint32_t>() == (uint32_t)stop_level)
                    return ACK_REACHED;
            } else {
                top.p_PIXCLK.set<bool>(false);
                if (edge + 1 < segment.edges) {
                    next_sample();
                    put_sample();
                }
                settle(time);
                next_edge();
            }
        }
        return SEGMENT_OVER;
    }

    // The microcontroller's transfer loop; cycle edges are at start + floor of `halves`.
    __attribute__((flatten)) void strobe(uint8_t *out, int64_t count, int64_t start, Steps halves) {
        for (int64_t i = 0; i < count; i++) {
            const int64_t rise = start + halves.value();
            if (!top.p_DCLK.get<bool>())
                sram.sample(rise);
            top.p_DCLK.set<bool>(true);
            settle(rise);
            halves.next();
            out[i] = top.p_DATA.get<uint8_t>();
            top.p_DCLK.set<bool>(false);
            settle(start + halves.value());
            halves.next();
        }
    }

private:
    const bool skipping;

    Segment segment = {};
    const uint8_t *pixels = nullptr;  // rows x active_columns, or null: all 0
    int64_t edge = 0;                 // the next one to be made
    Steps times{1, 1, 0};             // of that edge, from the segment's start
    int64_t row = 0, column = 0;      // of the sample on the lines

    // Lets everything follow the inputs, as of `time`; tells whether any register changed.
    bool settle(int64_t time) {
        bool changed = false;
        top.Top::eval(nullptr);
        while (top.Top::commit()) {
            changed = true;
            top.Top::eval(nullptr);
        }
        sram.drive(time, SramPins(top.p_SRAM__A.get<uint32_t>(), top.p_SRAM__CE__N.get<bool>(),
                                  top.p_SRAM__OE__N.get<bool>(), top.p_SRAM__WE__N.get<bool>(),
                                  top.p_SRAM__D__OE.get<bool>(), top.p_SRAM__D__O.get<uint8_t>()));
        // Only a register listens to the bus, so nothing else has to follow it.
        top.p_SRAM__D__I.set<uint8_t>(sram.bus());
        return changed;
    }

    void next_edge() {
        edge++;
        times.next();
    }

    void find_sample(int64_t n) {
        row = n / segment.line_clocks;
        column = n % segment.line_clocks;
    }

    void next_sample() {
        if (++column == segment.line_clocks) {
            column = 0;
            row++;
        }
    }

    void put_sample() {
        const bool inside = segment.rows && column < segment.active_columns;
        top.p_HSYNC.set<bool>(inside);
        const bool rendered = inside && pixels;
        top.p_PIXDATA.set<uint8_t>(rendered ? pixels[row * segment.active_columns + column] : 0);
    }

    // A clock that changed no register changes none the next time either, while its inputs stay:
    // go on with the falling edge of the last such clock. The SRAM sees no pulse meanwhile.
    void skip_low_samples(int64_t until) {
        const int64_t end = segment.rows ? (row + 1) * segment.line_clocks : segment.edges / 2;
        const int64_t last = std::min(end - 1, times.last_within(until - segment.start) / 2);
        if (last > edge / 2) {
            edge = 2 * last + 1;
            times.go_to(edge);
            find_sample(last);
        }
    }
};

}  // namespace

extern "C" {

Driver *driver_new(uint8_t *memory, const SramTiming *timing, int64_t keep, int32_t skipping) {
    return new Driver(memory, *timing, keep, skipping != 0);
}

void driver_delete(Driver *driver) { delete driver; }

// Number of the pin of that name, -1 when there is none.
int32_t driver_pin(const char *name) {
    for (size_t i = 0; i < sizeof PINS / sizeof *PINS; i++)
        if (strcmp(PINS[i].name, name) == 0)
            return (int32_t)i;
    return -1;
}

void driver_set(Driver *driver, int32_t pin, uint32_t value, int64_t now) {
    driver->set(PINS[pin], value, now);
}

uint32_t driver_get(const Driver *driver, int32_t pin) { return PINS[pin].get(driver->top); }

void driver_load(Driver *driver, const Segment *segment, int64_t edge) {
    driver->load(*segment, edge);
}

void driver_use_pixels(Driver *driver, const uint8_t *pixels) { driver->use_pixels(pixels); }

int32_t driver_burst(Driver *driver, int64_t until, int32_t stop_level, int64_t *reached) {
    return driver->burst(until, stop_level, *reached);
}

// The half period is numerator / denominator, the first edge at start + offset / denominator.
void driver_strobe(Driver *driver, uint8_t *out, int64_t count, int64_t start, int64_t numerator,
                   int64_t denominator, int64_t offset) {
    driver->strobe(out, count, start, Steps(numerator, denominator, offset));
}

// Number of violations kept; `out`, unless null, receives those from number `first` on.
int64_t driver_violations(const Driver *driver, int64_t first, Violation *out) {
    const std::vector<Violation> &kept = driver->sram.kept;
    if (out)
        std::copy(kept.begin() + first, kept.end(), out);
    return (int64_t)kept.size();
}

// Number of violations of one kind, kept or not.
int64_t driver_violation_count(const Driver *driver, int32_t kind) {
    return driver->sram.counts[kind];
}

}
