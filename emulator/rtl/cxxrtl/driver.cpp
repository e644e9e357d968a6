// Drives the compiled FPGA: pixel clock edges in, data clock cycles in, SRAMs beside it.
// One of these is behind every CompiledEngine; contract.py says what is asked of it and when.
//
// design.cpp is CXXRTL's output. Its eval() computes outputs and the registers' next values,
// commit() makes those current and tells whether any changed. Outputs lag a register change by
// one eval(), and an asynchronous reset takes one more, hence settle(). Edges are found before
// anything is computed, so one that eval() itself makes, on a clock that is no pin, needs another
// eval() before the commit.
//
// pins.h is made of the wiring; pins_header.py says what is in it.

#include "design.cpp"
#include "pins.h"
#include "sram_model.h"

#include <algorithm>
#include <cstring>
#include <utility>
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
    uint32_t initial;
    void (*set)(Top &, uint32_t);
    uint32_t (*get)(const Top &);
};

#define GETTER(port) [](const Top &top) { return top.port.template get<uint32_t>(); }
#define INPUT(name, port, initial) \
    {name, initial, [](Top &top, uint32_t value) { top.port.template set<uint32_t>(value); }, \
     GETTER(port)},
#define OUTPUT(name, port) {name, 0, nullptr, GETTER(port)},

const Pin PIN_TABLE[] = {PINS};

// A register of the design, for upsets.
struct Register {
    const char *name;
    int32_t bits;
    void (*flip)(Top &, int32_t);
    const uint32_t *(*levels)(const Top &);
};

template <size_t Bits> void flip_bit(cxxrtl::wire<Bits> &wire, int32_t bit) {
    const uint32_t mask = 1u << bit % 32;
    wire.curr.data[bit / 32] ^= mask;
    wire.next.data[bit / 32] ^= mask;
}

#define REGISTER(name, port, bits) \
    {name, bits, [](Top &top, int32_t bit) { flip_bit(top.port, bit); }, \
     [](const Top &top) -> const uint32_t * { return top.port.curr.data; }},

const Register REGISTER_TABLE[] = {REGISTERS {nullptr, 0, nullptr, nullptr}};
const int32_t REGISTER_COUNT = (int32_t)(sizeof REGISTER_TABLE / sizeof *REGISTER_TABLE) - 1;

// The lines of camera number N.
template <int N> struct Camera;

#define CAMERA(number, clock_, data_, line_, frame_) \
    template <> struct Camera<number> { \
        template <class Model> static void clock(Model &top, bool level) { \
            top.clock_.template set<bool>(level); \
        } \
        template <class Model> static void data(Model &top, uint8_t value) { \
            top.data_.template set<uint8_t>(value); \
        } \
        template <class Model> static void line(Model &top, bool level) { \
            top.line_.template set<bool>(level); \
        } \
        static void frame(Top &top, bool level) { (void)top, frame_; } \
    };
CAMERAS

// The lines of memory number N.
template <int N> struct Memory;

#define MEMORY(number, a, d_i, d_o, d_oe, ce_n, oe_n, we_n) \
    template <> struct Memory<number> { \
        template <class Model> static SramPins pins(const Model &top) { \
            return SramPins( \
                top.a.template get<uint32_t>(), top.ce_n.template get<bool>(), \
                top.oe_n.template get<bool>(), top.we_n.template get<bool>(), \
                top.d_oe.template get<bool>(), top.d_o.template get<uint8_t>()); \
        } \
        template <class Model> static void offer(Model &top, uint8_t value) { \
            top.d_i.template set<uint8_t>(value); \
        } \
    };
MEMORIES

// A segment of a camera's stream as pixel_clock.py describes it; edge k is at
// start + floor(k * half_numerator / half_denominator).
struct Segment {
    int64_t start, half_numerator, half_denominator, edges;
    int64_t rows, line_clocks, active_columns, vsync;
};

// Clocks that are worth to be made at once.
constexpr int64_t SHORTEST_STRIDE = 4;

// What a camera sends, and how far it is.
struct Stream {
    Segment segment = {};
    const uint8_t *pixels = nullptr;  // rows x active_columns, or null: all 0
    int64_t edge = 0;                 // the next one to be made
    Steps times{1, 1, 0};             // of that edge, from the segment's start
    int64_t row = 0, column = 0;      // of the sample on the lines

    int64_t time() const { return segment.start + times.value(); }

    bool over() const { return edge >= segment.edges; }

    void next_edge() {
        edge++;
        times.next();
    }

    // Continue with that edge; the sample on the lines is what the edges before it left there.
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

    // A clock is to rise that has many more behind it in its row.
    bool in_row() const {
        return edge % 2 == 0 && pixels && inside() &&
               segment.active_columns - column > SHORTEST_STRIDE + 2;
    }

    uint8_t pixel() const {
        return inside() && pixels ? pixels[row * segment.active_columns + column] : 0;
    }

    // First edge after `time`.
    int64_t edge_after(int64_t time) const { return times.last_within(time - segment.start) + 1; }

    // A clock that changed no register changes none the next time either, while its inputs stay:
    // go on with the falling edge of the last such clock. The SRAMs see no pulse meanwhile.
    void skip_low_samples(int64_t until) {
        const int64_t end = segment.rows ? (row + 1) * segment.line_clocks : segment.edges / 2;
        const int64_t last = std::min(end - 1, times.last_within(until - segment.start) / 2);
        if (last > edge / 2)
            go_to(2 * last + 1);
    }
};

#ifdef BUS_HIGH
// Transactions as external_bus.py describes them; an event's cycle k is at
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

// In the order of Outcome.
enum Outcome : int32_t { TIME_REACHED, ACKNOWLEDGE_CHANGED, SEGMENT_OVER };

class Driver {
public:
    Driver(uint8_t *const *memories, const SramTiming &timing, int64_t keep, bool skipping)
        : log(keep), skipping(skipping), strides(skipping) {
        for (int n = 0; n < MEMORY_COUNT; n++)
            srams.emplace_back(memories[n], timing, log, n);
        for (const Pin &pin : PIN_TABLE)
            if (pin.set)
                pin.set(top, pin.initial);
        settle(0);
    }

    Top top;
    ViolationLog log;

    void set(const Pin &pin, uint32_t value, int64_t now) {
        if (strcmp(pin.name, DATA_CLOCK_NAME) == 0 && value && !top.DATA_CLOCK.get<bool>())
            sample(now);
        pin.set(top, value);
        settle(now);
    }

    void flip(const Register &target, int32_t bit, int64_t now) {
        target.flip(top, bit);
        settle(now);
    }

    void power(int memory, bool on, int64_t now) {
        srams[memory].power(on);
        settle(now);
    }

    void load(int camera, const Segment &next, int64_t edge) {
        Stream &stream = streams[camera];
        stream.segment = next;
        stream.pixels = nullptr;
        stream.times = Steps(next.half_numerator, next.half_denominator, 0);
        stream.go_to(edge);
        with(camera, [&](auto n) {
            Camera<n()>::frame(top, next.vsync);
            put_sample<n()>(top);
        });
    }

    void use_pixels(int camera, const uint8_t *rendered) {
        streams[camera].pixels = rendered;
        with(camera, [&](auto n) { put_sample<n()>(top); });
    }

    // Makes the edges of the cameras in the mask `running` up to `until`, or up to the one that
    // changes an acknowledge, or that is the last of a segment. `reached` is the time then,
    // `camera` the one whose segment is over.
    Outcome burst(int64_t until, uint32_t running, int64_t &reached, int32_t &camera) {
#define VARIANT(number) \
    if (suits_##number(top)) { \
        copy_##number(top, variant_##number); \
        hold_##number(top, variant_##number); \
        variant_##number.eval(nullptr); \
        if (same_##number(top, variant_##number)) { \
            const Outcome outcome = burst_on(variant_##number, until, running, reached, camera); \
            copy_##number(variant_##number, top); \
            top.eval(nullptr); \
            forget_derived_edges(top); \
            return outcome; \
        } \
    }
        VARIANTS
#undef VARIANT
        return burst_on(top, until, running, reached, camera);
    }

    // The microcontroller's transfer loop; cycle edges are at start + floor of `halves`.
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

#ifdef BUS_HIGH
    // Makes the events of `wanted` from number `event` on, with the edges of the cameras in the
    // mask `running` up to each. Returns the next event: the one before which a camera's segment is
    // over or an acknowledge changed, or, with `over`, the one after the last.
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

    const bool skipping;
    bool strides;                // whether clocks may be made at once
    int64_t clocks_at_once = 0;  // how many were

private:
    std::vector<Sram> srams;
    Stream streams[CAMERA_COUNT];
    uint32_t contention = 0;

    // The design at some levels of its pins; variants.py says more.
#define VARIANT(number) variant_##number##_steps variant_##number;
    VARIANTS
#undef VARIANT

    // Calls `act` with the camera's number as a constant.
    template <int N = 0, class Act> void with(int camera, Act act) {
        if (camera == N)
            act(std::integral_constant<int, N>());
        else if constexpr (N + 1 < CAMERA_COUNT)
            with<N + 1>(camera, act);
    }

    bool settle(int64_t time) { return settle(top, time); }

    // Lets everything follow the inputs, as of `time`; tells whether any register changed.
    template <class Model> bool settle(Model &top, int64_t time) {
        bool changed = false;
        eval(top);
        while (commit(top)) {
            changed = true;
            eval(top);
        }
        drive_memories(top, time, std::make_integer_sequence<int, MEMORY_COUNT>());
        const uint32_t now_contended = CONTENTION;
        if (now_contended & ~contention)
            log.add({WIRE_CONTENTION, time, 0, now_contended, 0, -1});
        contention = now_contended;
        return changed;
    }

    template <class Model> void eval(Model &top) {
        eval_once(top);
        if (derived_edge(top))
            eval_once(top);
    }

    // Once in the library: a large design would not stay in the processor's instruction cache, and
    // take half a minute to compile.
    template <class Model> __attribute__((noinline, flatten)) static void eval_once(Model &top) {
        top.Model::eval(nullptr);
    }
    template <class Model> __attribute__((noinline, flatten)) static bool commit(Model &top) {
        return top.Model::commit();
    }

    // Only registers listen to the memories, and the external bus: nothing else has to follow them.
    template <class Model, int... N>
    void drive_memories(Model &top, int64_t time, std::integer_sequence<int, N...>) {
        (srams[N].drive(time, Memory<N>::pins(top)), ...);
        (Memory<N>::offer(top, srams[N].bus()), ...);
#ifdef BUS_HIGH
        if ((srams[N].reads() || ...))
            eval(top);
#endif
    }

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

    void sample(int64_t time) {
        for (Sram &sram : srams)
            sram.sample(time);
    }

    bool writes() const {
        return std::any_of(srams.begin(), srams.end(), [](auto &sram) { return sram.writes(); });
    }

    template <class Model> static uint32_t acknowledges(const Model &top) { return ACKNOWLEDGES; }

    template <int N, class Model> void put_sample(Model &top) {
        Camera<N>::line(top, streams[N].inside());
        Camera<N>::data(top, streams[N].pixel());
    }

    template <class Model>
    Outcome burst_on(Model &top, int64_t until, uint32_t running, int64_t &reached,
                     int32_t &camera) {
        Outcome outcome = TIME_REACHED;
        if (running & (running - 1))
            return burst_of_several(top, until, running, reached, camera);
        for (camera = 0; running >> (camera + 1); camera++) {}
        with(camera, [&](auto n) { outcome = burst_of_one<n()>(top, until, reached); });
        return outcome;
    }

    template <int N, class Model> void make_edge(Model &top, int64_t time, int64_t until) {
        Stream &stream = streams[N];
        if (stream.edge % 2 == 0) {
            const bool wrote = writes();
            Camera<N>::clock(top, true);
            const bool changed = settle_rise<N>(top, time);
            stream.next_edge();
            if (skipping && !changed && !wrote && !stream.inside())
                stream.skip_low_samples(until);
            return;
        }
        Camera<N>::clock(top, false);
        if (stream.edge + 1 < stream.segment.edges) {
            stream.next_sample();
            put_sample<N>(top);
        }
        settle_fall<N>(top, time);
        stream.next_edge();
    }

    // Settling after an edge of camera N's clock. A copy makes this edge's share only, unless its
    // registers are in reset; clock_steps.py says more.
    template <int N> bool settle_rise(Top &top, int64_t time) { return settle(top, time); }
    template <int N> void settle_fall(Top &top, int64_t time) { settle(top, time); }

    template <int N, class Model> bool settle_rise(Model &top, int64_t time) {
        constexpr std::integral_constant<int, N> camera;
        if (top.in_reset(camera))
            return settle_in_reset(top, time);
        const bool changed = top.rise(camera);
        if (top.in_reset(camera))
            return settle_in_reset(top, time) | changed;
        follow<N>(top, time);
        return changed;
    }

    template <int N, class Model> void settle_fall(Model &top, int64_t time) {
        constexpr std::integral_constant<int, N> camera;
        if (top.in_reset(camera)) {
            settle_in_reset(top, time);
            return;
        }
        top.fall(camera);
        follow<N>(top, time);
    }

    template <class Model>
    __attribute__((noinline)) bool settle_in_reset(Model &top, int64_t time) {
        return settle(top, time);
    }

    // Lets the memories follow that a camera's clock can move.
    template <int N, class Model> void follow(Model &top, int64_t time) {
        follow<N>(top, time, std::make_integer_sequence<int, MEMORY_COUNT>());
    }
    template <int N, class Model, int... M>
    void follow(Model &top, int64_t time, std::integer_sequence<int, M...>) {
        (follow_one<N, M>(top, time), ...);
    }
    template <int N, int M, class Model> void follow_one(Model &top, int64_t time) {
        if constexpr (Model::may_move(std::integral_constant<int, N>(), M)) {
            srams[M].drive(time, Memory<M>::pins(top));
            Memory<M>::offer(top, srams[M].bus());
        }
    }

    // Makes at once the clocks of camera N that a stride describes, up to `until`. The row's last one,
    // and one more, are left, so that an ordinary clock follows.
    template <int N, class Model> void store_strides(Model &top, int64_t until) {
        store_strides<N>(top, until, std::make_integer_sequence<int, STRIDE_COUNT>());
    }
    template <int N, class Model, int... K>
    void store_strides(Model &top, int64_t until, std::integer_sequence<int, K...>) {
        (void)top, (void)until;
        (store_stride<N, K>(top, until), ...);
    }
    template <int N, int K, class Model> void store_stride(Model &top, int64_t until) {
        if constexpr (Stride<K>::camera == N) {
            constexpr std::integral_constant<int, K> stride;
            Stream &stream = streams[N];
            const Segment &segment = stream.segment;
            Sram &sram = srams[Stride<K>::memory];
            const int64_t half = segment.half_numerator / segment.half_denominator;
            if (!stride_ready(stride, top) || !sram.stores_at(stream.time(), half, 2 * half))
                return;
            const int64_t counter = stride_counter(stride, top);
            const int64_t edges = stream.times.last_within(until - segment.start) + 1 - stream.edge;
            const int64_t clocks =
                std::min({segment.active_columns - 1 - stream.column, Stride<K>::last - counter,
                          edges / 2}) - 1;
            if (clocks < SHORTEST_STRIDE)
                return;
            const uint8_t *next =
                stream.pixels + stream.row * segment.active_columns + stream.column;
            const int64_t end = stream.edge + 2 * clocks;
            stream.go_to(end - 2);
            const int64_t rose = stream.time();
            stream.next_edge();
            const int64_t fell = stream.time();
            sram.store(next, clocks, rose, fell);
            stride_to(stride, top, counter + clocks, next[clocks - 1]);
            stream.go_to(end);
            put_sample<N>(top);
            clocks_at_once += clocks;
        }
    }

    // Reads into `out` at once what a stride describes, but the last one of `count` bytes at least;
    // how many. The next edge is number `edge` of `halves`.
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

    template <int N, class Model>
    __attribute__((flatten)) Outcome burst_of_one(Model &top, int64_t until, int64_t &reached) {
        const uint32_t before = acknowledges(top);
        while (!streams[N].over()) {
            if (strides && streams[N].in_row())
                store_strides<N>(top, until);
            const int64_t time = streams[N].time();
            if (time > until) {
                reached = until;
                return TIME_REACHED;
            }
            reached = time;
            make_edge<N>(top, time, until);
            if (acknowledges(top) != before)
                return ACKNOWLEDGE_CHANGED;
        }
        return SEGMENT_OVER;
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
            with(camera, [&](auto n) { make_edge<n()>(top, time, until); });
            if (acknowledges(top) != before)
                outcome = ACKNOWLEDGE_CHANGED;
            else if (streams[camera].over())
                outcome = SEGMENT_OVER;
            else
                continue;
            for (int n = 0; n < CAMERA_COUNT; n++)
                if (running >> n & 1)
                    with(n, [&](auto constant) { come_back<constant()>(top, time, n > camera); });
            return outcome;
        }
    }

    // Takes back what was skipped beyond `now`: the pins may change before that. An edge at this
    // very instant may be `still_to_come`.
    template <int N, class Model> void come_back(Model &top, int64_t now, bool still_to_come) {
        Stream &stream = streams[N];
        const int64_t next = stream.edge_after(now - still_to_come);
        if (stream.edge <= next)
            return;
        stream.go_to(next);
        Camera<N>::clock(top, next % 2);
        settle(top, now);
    }
};

}  // namespace

extern "C" {

Driver *driver_new(uint8_t *const *memories, const SramTiming *timing, int64_t keep,
                   int32_t skipping) {
    return new Driver(memories, *timing, keep, skipping != 0);
}

void driver_delete(Driver *driver) { delete driver; }

// Number of the pin of that name, -1 when there is none.
int32_t driver_pin(const char *name) {
    for (size_t i = 0; i < sizeof PIN_TABLE / sizeof *PIN_TABLE; i++)
        if (strcmp(PIN_TABLE[i].name, name) == 0)
            return (int32_t)i;
    return -1;
}

void driver_set(Driver *driver, int32_t pin, uint32_t value, int64_t now) {
    driver->set(PIN_TABLE[pin], value, now);
}

uint32_t driver_get(const Driver *driver, int32_t pin) { return PIN_TABLE[pin].get(driver->top); }

// Name and bits of register number `index`; null behind the last one.
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

// Levels of all registers into `out`, unless null; how many words of 32 bits.
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

void driver_load(Driver *driver, int32_t camera, const Segment *segment, int64_t edge) {
    driver->load(camera, *segment, edge);
}

void driver_use_pixels(Driver *driver, int32_t camera, const uint8_t *pixels) {
    driver->use_pixels(camera, pixels);
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

// Number of violations kept; `out`, unless null, receives those from number `first` on.
int64_t driver_violations(const Driver *driver, int64_t first, Violation *out) {
    const std::vector<Violation> &kept = driver->log.kept;
    if (out)
        std::copy(kept.begin() + first, kept.end(), out);
    return (int64_t)kept.size();
}

// Number of violations of one kind, kept or not.
int64_t driver_violation_count(const Driver *driver, int32_t kind) {
    return driver->log.counts[kind];
}

}
