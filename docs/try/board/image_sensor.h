// The MLX75412 as emulator/camera/mlx75412/sensor.py has it, for pictures: their pixels do not
// depend on exposure and time. constants.h is generated from the sensor's table.

#pragma once

#include "constants.h"
#include "stream.h"

#include <deque>
#include <functional>
#include <map>

namespace board {

class ImageSensor {
public:
    std::function<void()> on_change;  // the pixel lines differ from what was announced

    ImageSensor() { reset_registers(); }

    // The part of the stream at `time`; false without a pixel clock.
    bool segment_at(int64_t time, Segment &found) {
        if (!clocked) return false;
        if (spans.empty()) append({0, IDLE_CLOCKS, 0});
        while (spans.back().cut || edge(spans.back().end()) <= time)
            append(after(spans.back()));
        for (const Span &span : spans)
            if (!span.cut && edge(span.end()) > time) {
                found = {edge(span.first), PIXEL_PERIOD / 2, 1, 2 * span.clocks,
                         span.rows, LINE_CLOCKS, COLUMNS, span.vsync};
                return true;
            }
        return false;
    }

    void power(bool on, int64_t now) { powered = on, start_or_stop(now); }
    void reset_pin(bool level, int64_t now) { in_reset = !level, start_or_stop(now); }

    bool answers(int address) const { return clocked && address == CAMERA_ADDRESS; }

    bool enabled() const { return clocked && active.at(MODE_SELECT) & MODE_SELECT_ENABLE; }

    // A write message: the address of a register, then bytes for it and the following ones.
    void write(const std::vector<uint8_t> &message, int64_t now) {
        if (!clocked || message.size() < 2) return;
        const bool was_enabled = enabled();
        bool stale = false;
        pointer = message[0] << 8 | message[1];
        for (size_t n = 2; n < message.size(); n++) {
            const uint16_t address = pointer++;
            const auto found = written.find(address);
            if (found == written.end()) continue;
            found->second = message[n];
            if (address == SYNC) {
                written[SYNC] = 0;
                if (message[n] == SYNC_APPLY) active = written, stale = true;
            } else if (!synced.at(address)) {
                active[address] = message[n];
            }
        }
        if (enabled() != was_enabled || stale)
            replan(now, enabled() != was_enabled);
    }

    uint8_t read() {
        const auto found = written.find(pointer++);
        return found == written.end() ? 0 : found->second;
    }

private:
    // A part of the output, in numbers of clocks.
    struct Span {
        int64_t first, clocks;
        int vsync;
        int frame = -1;     // number since the sensor was enabled; 0 has an undefined exposure
        int64_t lines = 0;  // from the frame's start to that of the next one
        int rows = 0;
        bool cut = false;  // ended early by a change

        int64_t end() const { return first + clocks; }
    };

    std::deque<Span> spans;
    std::map<uint16_t, uint8_t> written, active;
    std::map<uint16_t, bool> synced;
    bool powered = true, in_reset = false, clocked = true;
    int64_t origin = 0;
    uint16_t pointer = 0;

    int64_t edge(int64_t clock) const { return origin + clock * PIXEL_PERIOD; }

    int64_t value(uint16_t address, int bytes) const {
        int64_t found = 0;
        while (bytes--) found = found << 8 | active.at(address++);
        return found;
    }

    void reset_registers() {
        pointer = 0;
        for (const CameraByte &one : CAMERA_BYTES)
            written[one.address] = active[one.address] = one.reset, synced[one.address] = one.synced;
    }

    void start_or_stop(int64_t now) {
        const bool run = powered && !in_reset;
        if (run == clocked) return;
        reset_registers();
        clocked = run, origin = now;
        spans.clear();
        on_change();
    }

    void append(const Span &span) {
        spans.push_back(span);
        if (spans.size() > REMEMBERED) spans.pop_front();
    }

    Span after(const Span &last) const {
        if (!enabled()) return {last.end(), IDLE_CLOCKS, 0};
        if (last.frame < 0 || last.cut) return read_out(last.end(), 0);
        if (!last.rows) return read_out(last.end(), last.frame + 1);
        return {last.end(), (last.lines - ROWS) * LINE_CLOCKS, last.frame == 0, last.frame,
                last.lines};
    }

    Span read_out(int64_t first, int frame) const {
        const int64_t rate = value(FRAMES_PER_SECOND, 2);
        const int64_t clocks = 2 * rate * LINE_CLOCKS;
        const int64_t nearest =
            rate ? (2 * value(CLOCKS_PER_SECOND, 4) + clocks / 2) / clocks : MOST_FRAME_LINES;
        const int64_t lines = std::min(std::max(nearest, FEWEST_FRAME_LINES), MOST_FRAME_LINES);
        return {first, ROWS * LINE_CLOCKS, 1, frame, lines, ROWS};
    }

    // Drops the spans from `now` on; with `cut`, ends the present one too.
    void replan(int64_t now, bool cut) {
        Segment present;
        segment_at(now, present);
        const int64_t clock =
            std::max<int64_t>(0, (now - origin + PIXEL_PERIOD - 1) / PIXEL_PERIOD);
        while (spans.size() > 1 && spans.back().first >= clock) spans.pop_back();
        if (cut) spans.back().clocks = clock - spans.back().first, spans.back().cut = true;
        on_change();
    }
};

}  // namespace board
