// The data clock, by which the microcontroller reads a picture.

#pragma once

#include "bursts.h"

namespace {

class Reading : public Bursts {
public:
    using Bursts::Bursts;

    void set(int32_t pin, uint32_t value, int64_t now) {
        if (pin == DATA_CLOCK_NUMBER) {
            const bool was = top.DATA_CLOCK.get<bool>();
            if (strides && was != (bool)value && clock_in_stride((bool)value, now)) return;
            if (value && !was) sample(now);
        }
        Settled::set(PIN_TABLE[pin], value, now);
    }

    // Runs the microcontroller's transfer loop; clock edges are at start + floor of `halves`.
    __attribute__((flatten)) void strobe(uint8_t *out, int64_t count, int64_t start, Steps halves) {
        for (int64_t i = 0; i < count; i++) {
            if (strides)
                if (const int64_t read = read_strides(out + i, count - i, start, halves, 2 * i)) {
                    i += read;
                    halves.go_to(2 * i);
                }
            const int64_t rise = start + halves.value();
            if (!top.DATA_CLOCK.get<bool>())
                sample(rise);
            top.DATA_CLOCK.set<bool>(true);
            settle(rise);
            halves.next();
            out[i] = top.DATA.get<uint8_t>();
            top.DATA_CLOCK.set<bool>(false);
            settle(start + halves.value());
            halves.next();
        }
    }

private:
    // An edge of the data clock within a stride: all but the address and the byte that the design
    // shows is known, and a falling edge changes nothing.
    bool clock_in_stride(bool level, int64_t now) {
        return clock_in_stride(level, now, std::make_integer_sequence<int, STRIDE_COUNT>());
    }
    template <int... K>
    bool clock_in_stride(bool level, int64_t now, std::integer_sequence<int, K...>) {
        (void)level, (void)now;
        return (... || clock_in_stride<K>(level, now));
    }
    template <int K> bool clock_in_stride(bool level, int64_t now) {
        if constexpr (!FOREIGN && Stride<K>::camera < 0) {
            constexpr std::integral_constant<int, K> stride;
            Sram &sram = srams[Stride<K>::memory];
            const int64_t counter = stride_counter(stride, top);
            // Before and after the edge the design is in the stride.
            if (counter + 1 >= Stride<K>::last || !stride_ready(stride, top)) return false;
            if (level) {
                if (!sram.offers_at(now, INT64_MAX)) return false;
                uint8_t byte;
                sram.offer(&byte, 1, now);
                stride_to(stride, top, counter + 1, byte);
                Memory<Stride<K>::memory>::offer(top, sram.bus());
                clocks_at_once++;
            }
            top.DATA_CLOCK.set<bool>(level);
            forget_edges(top);
            if (level) eval_once(top);
            return true;
        }
        return false;
    }

    // Reads a stride into `out` in one step, leaving at least the last of `count` bytes; returns
    // the number of bytes. The next edge is number `edge` of `halves`.
    int64_t read_strides(uint8_t *out, int64_t count, int64_t start, Steps halves, int64_t edge) {
        return read_strides(out, count, start, halves, edge,
                            std::make_integer_sequence<int, STRIDE_COUNT>());
    }
    template <int... K>
    int64_t read_strides(uint8_t *out, int64_t count, int64_t start, Steps halves, int64_t edge,
                         std::integer_sequence<int, K...>) {
        int64_t read = 0;
        (void)(... || (read = read_stride<K>(out, count, start, halves, edge)));
        return read;
    }
    template <int K>
    int64_t read_stride(uint8_t *out, int64_t count, int64_t start, Steps halves, int64_t edge) {
        if constexpr (Stride<K>::camera < 0) {
            constexpr std::integral_constant<int, K> stride;
            Sram &sram = srams[Stride<K>::memory];
            if (count <= SHORTEST_STRIDE || top.DATA_CLOCK.get<bool>() || !stride_ready(stride, top))
                return 0;
            const int64_t counter = stride_counter(stride, top);
            const int64_t clocks = std::min(count, Stride<K>::last - counter) - 1;
            const int64_t rise = start + halves.value();
            halves.go_to(edge + 2);
            const int64_t period = start + halves.value() - rise - 1;
            if (clocks < SHORTEST_STRIDE || !sram.offers_at(rise, period))
                return 0;
            halves.go_to(edge + 2 * (clocks - 1));
            sram.offer(out, clocks, start + halves.value());
            stride_to(stride, top, counter + clocks, out[clocks - 1]);
            Memory<Stride<K>::memory>::offer(top, sram.bus());
            clocks_at_once += clocks;
            return clocks;
        }
        return 0;
    }
};

}  // namespace
