// The compiled FPGA design and its camera, as emulator/rtl/contract.py runs an engine: lazily,
// and only while the camera's clock can change anything.

#pragma once

#include "driver.cpp"
#include "image_sensor.h"

namespace board {

constexpr SramTiming TIMING = {SRAM_TIMING_VALUES};

class Fpga {
public:
    Driver *const driver;
    int64_t now = 0;
    uint8_t sky[ROWS * COLUMNS] = {};  // what the camera sees
    uint8_t memory[SRAM_BYTES] = {};

    explicit Fpga(ImageSensor &camera)
        : driver(driver_new(memories, &TIMING, MOST_VIOLATIONS, true)), camera(camera),
          enable(driver_pin("ENABLE")), rnw(driver_pin("RNW")), ack(driver_pin("ACK")),
          clock(driver_pin("PIXCLK")) {
        follow_source(0);
    }

    // Whether the camera's clock must run now; renders pixels that may be stored.
    uint32_t running() {
        if (!loaded || !get(enable) || get(rnw)) return 0;
        if (!get(ack) && segment.rows && !rendered) {
            std::copy(std::begin(sky), std::end(sky), frame);
            driver_use_pixels(driver, 0, frame, now);
            rendered = true;
        }
        return 1;
    }

    void run(int64_t until) {
        until = std::max(now, until);
        while (running()) {
            int64_t reached = now;
            int32_t number = 0;
            const int32_t end = driver_burst(driver, until, 1, &reached, &number);
            now = std::max(now, reached);
            if (end == SEGMENT_OVER)
                follow_segment();
            else if (end == TIME_REACHED)
                return;
        }
        skipped = loaded;
        now = until;
    }

    // Goes on after a burst that other code ran.
    uint32_t attend(int64_t reached, int32_t end, int64_t until) {
        now = std::max(now, reached);
        if (end == SEGMENT_OVER) follow_segment();
        run(until);
        return running();
    }

    void set(int32_t pin, uint32_t level) {
        catch_up();
        driver_set(driver, pin, level, now);
    }

    void stream_changed() { follow_source(now); }

private:
    uint8_t frame[ROWS * COLUMNS] = {};
    uint8_t *memories[1] = {memory};
    ImageSensor &camera;
    const int32_t enable, rnw, ack, clock;
    Segment segment = {};
    bool loaded = false, rendered = false;
    bool skipped = false;  // clocks that change nothing did not run
    int64_t entered = 0, entered_edge = 0;

    uint32_t get(int32_t pin) const { return driver_get(driver, pin); }
    int64_t time_of(int64_t edge) const { return segment.start + edge * segment.half_numerator; }

    // Sets the clock to the level that it would have without skipped clocks.
    void catch_up() {
        if (!skipped) return;
        skipped = false;
        const int64_t start = entered, edge = entered_edge;
        follow_source(now + 1);
        if ((entered != start || entered_edge != edge) && entered_edge % 2)
            driver_set(driver, clock, 1, now);
    }

    // Continues with the camera's first edge at `first` or later.
    void follow_source(int64_t first) {
        if (!camera.segment_at(now, segment)) return enter(false, 0);
        loaded = true, rendered = false;
        const int64_t half = segment.half_numerator;
        const int64_t wanted = (first - segment.start + half - 1) / half;
        const int64_t edge = std::min(std::max<int64_t>(wanted, 0), segment.edges);
        const bool at_rise = edge < segment.edges && time_of(edge) == now;
        if (edge % 2 == 0 && get(clock) && !at_rise) driver_set(driver, clock, 0, now);
        if (edge == segment.edges)
            follow_segment();
        else
            enter(true, edge);
    }

    void follow_segment() { enter(camera.segment_at(time_of(segment.edges), segment), 0); }

    void enter(bool next, int64_t edge) {
        loaded = next, rendered = false;
        entered = next ? segment.start : now, entered_edge = edge;
        if (next) return driver_load(driver, 0, &segment, edge, now);
        for (const char *name : {"PIXCLK", "PIXDATA", "HSYNC", "VSYNC"})
            driver_set(driver, driver_pin(name), 0, now);
    }
};

}  // namespace board
