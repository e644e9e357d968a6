// Bursts of edges of the cameras' pixel clocks.

#pragma once

#include "settled.h"
#include "stream.h"

namespace {

// In the order of BurstEnd in contract.py.
enum Outcome : int32_t { TIME_REACHED, ACKNOWLEDGE_CHANGED, SEGMENT_OVER };

class Bursts : public Settled {
public:
    Bursts(uint8_t *const *memories, const SramTiming &timing, int64_t keep, bool skipping)
        : Settled(memories, timing, keep), skipping(skipping), strides(skipping) {}

    void load(int camera, const Segment &next, int64_t edge, int64_t now) {
        Stream &stream = streams[camera];
        stream.segment = next;
        stream.pixels = nullptr;
        stream.times = Steps(next.half_numerator, next.half_denominator, 0);
        stream.go_to(edge);
        with(camera, [&](auto n) {
            Camera<n()>::frame(top, next.vsync);
            put_sample<n()>(top, stream);
        });
        if (FOREIGN)
            settle(now);
    }

    void use_pixels(int camera, const uint8_t *rendered, int64_t now) {
        streams[camera].pixels = rendered;
        with(camera, [&](auto n) { put_sample<n()>(top, streams[camera]); });
        if (FOREIGN)
            settle(now);
    }

    // Runs the edges of the cameras in the mask `running` up to `until`, or up to one that changes
    // an acknowledge or is the last of a segment. Sets `reached` to that time, and `camera` to the
    // one whose segment is over.
    Outcome burst(int64_t until, uint32_t running, int64_t &reached, int32_t &camera) {
#define VARIANT(number) \
    if (suits_##number(top)) { \
        copy_##number(top, variant_##number); \
        hold_##number(top, variant_##number); \
        variant_##number.eval(nullptr); \
        if constexpr (FOREIGN) { \
            copy_##number(top, variant_##number); \
            hold_##number(top, variant_##number); \
            forget_edges(variant_##number); \
            variant_##number.eval(nullptr); \
        } \
        if (same_##number(top, variant_##number)) { \
            const Outcome outcome = burst_on(variant_##number, until, running, reached, camera); \
            variant_##number.keep(); \
            copy_##number(variant_##number, top); \
            top.eval(nullptr); \
            forget_derived_edges(top); \
            if constexpr (FOREIGN) \
                forget_clocks(); \
            return outcome; \
        } \
    }
        VARIANTS
#undef VARIANT
        return burst_on(top, until, running, reached, camera);
    }

    const bool skipping;
    bool strides;                // whether strides are allowed
    int64_t clocks_at_once = 0;  // number of clocks within strides

protected:
    template <class Model>
    Outcome burst_on(Model &top, int64_t until, uint32_t running, int64_t &reached,
                     int32_t &camera) {
        Outcome outcome = TIME_REACHED;
        for (Stream &stream : streams)
            stream.restless = true;
        if (running & (running - 1))
            return burst_of_several(top, until, running, reached, camera);
        for (camera = 0; running >> (camera + 1); camera++) {}
        with(camera, [&](auto n) { outcome = burst_of_one<n()>(top, until, reached); });
        return outcome;
    }

private:
    Stream streams[CAMERA_COUNT];

    // After a variant's burst: the design has not seen the clocks, so what it did at edges that it
    // sees now is undone.
    void forget_clocks() {
        forget_edges(top);
#define REGISTER(name, port, bits) top.port.next = top.port.curr;
        REGISTERS
#undef REGISTER
        top.eval(nullptr);
    }

    // The design with some pins at fixed levels; see variants.py.
#define VARIANT(number) variant_##number##_steps variant_##number;
    VARIANTS
#undef VARIANT

    // Calls `act` with the camera's number as a compile-time constant.
    template <int N = 0, class Act> void with(int camera, Act act) {
        if (camera == N)
            act(std::integral_constant<int, N>());
        else if constexpr (N + 1 < CAMERA_COUNT)
            with<N + 1>(camera, act);
    }

    template <int N, class Model> static void put_sample(Model &top, const Stream &stream) {
        Camera<N>::line(top, stream.inside());
        Camera<N>::data(top, stream.pixel());
    }

    template <int N, class Model> void run_edge(Model &top, int64_t time, int64_t until) {
        Stream &stream = streams[N];
        if (stream.edge % 2 == 0)
            run_rise<N>(top, stream, time, until, false);
        else
            run_fall<N>(top, stream, time);
    }

    // With `alone`, no other camera's clock runs.
    template <int N, class Model>
    void run_rise(Model &top, Stream &stream, int64_t time, int64_t until, bool alone) {
        const bool may_skip = skipping && !stream.restless && !stream.inside() &&
                              (alone || !FOREIGN) && !writes();
        Camera<N>::clock(top, true);
        const bool changed = settle_rise<N>(top, time, may_skip);
        stream.next_edge();
        if (may_skip && !changed)
            stream.skip_low_samples(until);
    }

    template <int N, class Model> void run_fall(Model &top, Stream &stream, int64_t time) {
        Camera<N>::clock(top, false);
        // The camera's lines move after its clock, so a falling edge samples the old levels.
        const bool fell = FOREIGN && settle_fall<N>(top, time);
        if (stream.edge + 1 < stream.segment.edges) {
            stream.next_sample();
            put_sample<N>(top, stream);
        }
        stream.restless = settle_fall<N>(top, time) || fell;
        stream.next_edge();
    }

    // Runs a stride of camera N, up to `until`, in one step. Leaves the last two clocks with the
    // same syncs, so that an ordinary clock follows.
    template <int N, class Model> void run_strides(Model &top, Stream &stream, int64_t until) {
        run_strides<N>(top, stream, until, std::make_integer_sequence<int, STRIDE_COUNT>());
    }
    template <int N, class Model, int... K>
    void run_strides(Model &top, Stream &stream, int64_t until, std::integer_sequence<int, K...>) {
        (void)top, (void)stream, (void)until;
        (void)(... || run_stride<N, K>(top, stream, until));
    }
    template <int N, int K, class Model>
    bool run_stride(Model &top, Stream &stream, int64_t until) {
        if constexpr (Stride<K>::camera == N) {
            constexpr std::integral_constant<int, K> stride;
            constexpr bool stores = Stride<K>::stores;
            if (stream.inside() != Stride<K>::line || !stride_ready(stride, top))
                return false;
            const Segment &segment = stream.segment;
            const uint8_t *const next = stream.rest_of_row();
            Sram &sram = srams[Stride<K>::memory];
            const int64_t half = segment.half_numerator / segment.half_denominator;
            if (stores && !(next && sram.stores_at(stream.time(), half, 2 * half)))
                return false;
            const int64_t counter = stride_counter(stride, top);
            const int64_t edges = stream.times.last_within(until - segment.start) + 1 - stream.edge;
            int64_t clocks = std::min(stream.clocks_alike() - 1, edges / 2);
            if (Stride<K>::last >= 0)
                clocks = std::min(clocks, Stride<K>::last - counter);
            clocks--;
            // The last clock may take any byte, as no other one of the stride has it.
            if (Stride<K>::below < 256 && next && clocks > 0)
                clocks = std::min(clocks, first_from(next, clocks, Stride<K>::below) + 1);
            if (clocks < SHORTEST_STRIDE)
                return false;
            const int64_t end = stream.edge + 2 * clocks;
            if constexpr (stores) {
                stream.go_to(end - 2);
                const int64_t rose = stream.time();
                stream.next_edge();
                const int64_t fell = stream.time();
                sram.store(next, clocks, rose, fell);
            }
            stride_to(stride, top, counter + clocks, next ? next[clocks - 1] : 0);
            stream.go_to(end);
            put_sample<N>(top, stream);
            clocks_at_once += clocks;
            return true;
        }
        return false;
    }

    // Number of bytes before the first one of at least `limit`.
    static int64_t first_from(const uint8_t *bytes, int64_t count, int limit) {
        return std::find_if(bytes, bytes + count, [=](uint8_t b) { return b >= limit; }) - bytes;
    }

    template <int N, class Model>
    __attribute__((flatten)) Outcome burst_of_one(Model &top, int64_t until, int64_t &reached) {
        Stream stream = streams[N];  // a copy, as nothing else refers to it
        const Outcome outcome = burst_of_one<N>(top, stream, until, reached);
        streams[N] = stream;
        return outcome;
    }

    template <int N, class Model>
    Outcome burst_of_one(Model &top, Stream &stream, int64_t until, int64_t &reached) {
        const uint32_t before = acknowledges(top);
        const int64_t stop = stream.edges_until(until);
        int64_t time = reached;
        while (stream.edge < stop) {
            if (stream.edge % 2 == 0) {
                if (strides && stream.may_stride())
                    run_strides<N>(top, stream, until);
                time = stream.time();
                run_rise<N>(top, stream, time, until, true);
                if (acknowledges(top) != before)
                    return reached = time, ACKNOWLEDGE_CHANGED;
                if (stream.edge >= stop)
                    break;
            }
            time = stream.time();
            run_fall<N>(top, stream, time);
            if (acknowledges(top) != before)
                return reached = time, ACKNOWLEDGE_CHANGED;
        }
        reached = stream.over() ? time : until;
        return stream.over() ? SEGMENT_OVER : TIME_REACHED;
    }

    // At one instant the first camera's edge comes first.
    template <class Model>
    Outcome burst_of_several(Model &top, int64_t until, uint32_t running, int64_t &reached,
                             int32_t &camera) {
        const uint32_t before = acknowledges(top);
        Outcome outcome = TIME_REACHED;
        for (;;) {
            camera = -1;
            for (int n = 0; n < CAMERA_COUNT; n++)
                if (running >> n & 1 && (camera < 0 || streams[n].time() < streams[camera].time()))
                    camera = n;
            const int64_t time = streams[camera].time();
            if (time > until) {
                reached = until;
                return TIME_REACHED;
            }
            reached = time;
            with(camera, [&](auto n) { run_edge<n()>(top, time, until); });
            if (acknowledges(top) != before)
                outcome = ACKNOWLEDGE_CHANGED;
            else if (streams[camera].over())
                outcome = SEGMENT_OVER;
            else
                continue;
            for (int n = 0; n < CAMERA_COUNT; n++)
                if (running >> n & 1)
                    with(n, [&](auto constant) { go_back<constant()>(top, time, n > camera); });
            return outcome;
        }
    }

    // Undoes the skipping beyond `now`, as the pins may change before those edges. With
    // `include_now`, an edge at `now` itself has yet to run.
    template <int N, class Model> void go_back(Model &top, int64_t now, bool include_now) {
        Stream &stream = streams[N];
        const int64_t next = stream.edge_after(now - include_now);
        if (stream.edge <= next)
            return;
        stream.go_to(next);
        Camera<N>::clock(top, next % 2);
        settle(top, now);
    }
};

}  // namespace
