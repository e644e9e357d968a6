// A camera's stream, edge by edge of its pixel clock.

#pragma once

#include <algorithm>
#include <cstdint>

namespace {

// Times of evenly spaced edges, computed without a division per edge:
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

// A segment of a camera's stream, see pixel_clock.py; edge k is at
// start + floor(k * half_numerator / half_denominator).
struct Segment {
    int64_t start, half_numerator, half_denominator, edges;
    int64_t rows, line_clocks, active_columns, vsync;
};

// Shortest stride that is worth its overhead, in clocks.
constexpr int64_t SHORTEST_STRIDE = 4;

// A camera's stream, and the position in it.
struct Stream {
    Segment segment = {};
    const uint8_t *pixels = nullptr;  // rows x active_columns, or null: all 0
    int64_t edge = 0;                 // the next one
    Steps times{1, 1, 0};             // time of that edge, from the segment's start
    int64_t row = 0, column = 0;      // place of the sample on the lines
    bool restless = true;             // whether the last falling edge may have changed anything

    int64_t time() const { return segment.start + times.value(); }

    bool over() const { return edge >= segment.edges; }

    void next_edge() {
        edge++;
        times.next();
    }

    // Continues with edge `next`; the sample on the lines is that of the edges before it.
    void go_to(int64_t next) {
        edge = next;
        times.go_to(edge);
        row = edge / 2 / segment.line_clocks;
        column = edge / 2 % segment.line_clocks;
    }

    void next_sample() {
        if (++column == segment.line_clocks) {
            column = 0;
            row++;
        }
    }

    bool inside() const { return segment.rows && column < segment.active_columns; }

    // Clocks that remain of the row, or of the pause after it; of a blank segment, all.
    int64_t clocks_alike() const {
        if (!segment.rows)
            return segment.edges / 2 - edge / 2;
        return (inside() ? segment.active_columns : segment.line_clocks) - column;
    }

    // Whether the next edge rises, and enough clocks for a stride follow with the same syncs.
    bool may_stride() const { return edge % 2 == 0 && clocks_alike() > SHORTEST_STRIDE + 2; }

    // The pixels from the one on the lines on; null if they are all 0.
    const uint8_t *rest_of_row() const {
        return inside() && pixels ? pixels + row * segment.active_columns + column : nullptr;
    }

    uint8_t pixel() const {
        const uint8_t *const rest = rest_of_row();
        return rest ? *rest : 0;
    }

    // Number of the segment's edges up to `time`.
    int64_t edges_until(int64_t time) const {
        return time < segment.start ? 0 : std::min(segment.edges, edge_after(time));
    }

    // First edge after `time`.
    int64_t edge_after(int64_t time) const { return times.last_within(time - segment.start) + 1; }

    // After a clock whose edges both changed nothing, no further one does while the inputs stay the same:
    // continues with the falling edge of the last such clock. The SRAMs see no pulse meanwhile.
    void skip_low_samples(int64_t until) {
        const int64_t end = segment.rows ? (row + 1) * segment.line_clocks : segment.edges / 2;
        const int64_t last = std::min(end - 1, times.last_within(until - segment.start) / 2);
        if (last > edge / 2)
            go_to(2 * last + 1);
    }
};

}  // namespace
