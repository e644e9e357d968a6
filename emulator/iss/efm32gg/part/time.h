// Time in picoseconds: even clocks, and the schedule of events.
#pragma once

#include <cstdint>

namespace efm32gg {

constexpr int64_t SECOND = 1000000000000, MILLISECOND = SECOND / 1000,
                  MICROSECOND = MILLISECOND / 1000, NANOSECOND = 1000;
// Later than any time that can be represented (about 106 days): never.
constexpr int64_t NEVER = INT64_MAX;

// The one conversion to picoseconds: what does not fit is never.
constexpr int64_t picoseconds(__int128 exact) {
    return exact >= NEVER ? NEVER : (int64_t)exact;
}
// `span` after `time`.
constexpr int64_t later(int64_t time, int64_t span) { return picoseconds((__int128)time + span); }

// An even clock: edge k is at origin + floor(k * numerator / denominator) picoseconds.
class Rate {
public:
    Rate() = default;

    // `hertz` / `divider` edges per second, edge 0 at `origin`; 0 hertz: stopped.
    Rate(int64_t hertz, int64_t divider, int64_t origin)
        : origin(origin), hertz(hertz), divider(divider) {
        if (!hertz) return;
        numerator = (__int128)SECOND * divider;
        const int64_t common = (int64_t)gcd(numerator, hertz);
        numerator /= common;
        denominator = hertz / common;
        short_reach = (int64_t)(INT64_MAX / numerator) - 1;
        while (denominator > (int64_t)1 << bits)
            bits++;
        reciprocal = (uint64_t)((((unsigned __int128)1 << (63 + bits)) + denominator - 1) / denominator);
        short_span = numerator > INT64_MAX ? 0 : INT64_MAX / denominator - 1;
    }

    bool runs() const { return hertz != 0; }
    double frequency() const { return (double)hertz / (double)divider; }
    int64_t whole_hertz() const { return hertz / divider; }

    // Time of edge k; NEVER if the clock is stopped.
    int64_t time(int64_t k) const {
        if (!hertz) return NEVER;
        if (k >= 0 && k < short_reach)
            return later(origin, quotient((uint64_t)(k * (int64_t)numerator)));
        return picoseconds(origin + numerator * k / denominator);
    }

    // Number of edges after the origin, up to and including `time`.
    int64_t edges(int64_t time) const {
        if (!hertz || time < origin) return 0;
        if (time - origin < short_span)
            return ((time - origin + 1) * denominator - 1) / (int64_t)numerator;
        return (int64_t)((((__int128)(time - origin) + 1) * denominator - 1) / numerator);
    }

    // The first edge at or after `time`.
    int64_t edge_at_or_after(int64_t time) const {
        if (!hertz || time <= origin) return 0;
        return edges(time - 1) + 1;
    }

    // Picoseconds of n periods, rounded down; NEVER if the clock is stopped.
    int64_t span(int64_t n) const {
        return hertz ? picoseconds(numerator * n / denominator) : NEVER;
    }

    // The clock after a divider that starts at `start`.
    Rate divided(int64_t by, int64_t start) const { return {hertz, divider * by, start}; }

    bool same_frequency(const Rate &other) const {
        return (__int128)hertz * other.divider == (__int128)other.hertz * divider;
    }

    int64_t origin = 0;

private:
    int64_t hertz = 0, divider = 1;
    __int128 numerator = 1;
    int64_t denominator = 1;
    int64_t short_reach = 0, short_span = 0;  // edges and times whose products fit into 64 bits
    // 2^(63 + bits) / denominator, rounded up, where 2^bits is the first power that reaches the
    // denominator: exact for dividends below 2^63 (Granlund and Montgomery 1994, theorem 4.2).
    uint64_t reciprocal = (uint64_t)1 << 63;
    int bits = 0;

    int64_t quotient(uint64_t dividend) const {
        return (int64_t)((unsigned __int128)dividend * reciprocal >> (63 + bits));
    }

    static __int128 gcd(__int128 a, __int128 b) {
        while (b) {
            const __int128 rest = a % b;
            a = b;
            b = rest;
        }
        return a;
    }
};

// An event belongs to its peripheral and is in the schedule at most once.
struct Event {
    using Act = void (*)(void *owner, int64_t time);

    // Event overflow = Event::of<&Timer::on_overflow>(this), of a void on_overflow(int64_t time).
    template <auto Method, class Owner> static Event of(Owner *owner) {
        return {owner,
                [](void *self, int64_t time) { (static_cast<Owner *>(self)->*Method)(time); }};
    }

    void *owner;
    Act act;
    int64_t time = NEVER;
    uint64_t order = 0;
    int32_t place = -1;

    bool pending() const { return place >= 0; }
};

// Events by time; equal ones in the order in which they were scheduled. A binary heap; each event
// stores its place in it.
class Schedule {
public:
    static constexpr int32_t CAPACITY = 256;

    int64_t next_time() const { return count ? heap[0]->time : NEVER; }

    // Schedules `event` at `time`, or moves it there.
    void add(Event &event, int64_t time) {
        remove(event);
        if (time == NEVER || count == CAPACITY) return;
        event.time = time;
        event.order = orders++;
        place(count++, event);
        rise(event.place);
    }

    void remove(Event &event) {
        if (!event.pending()) return;
        const int32_t hole = event.place;
        event.place = -1;
        event.time = NEVER;
        if (hole == --count) return;
        Event &last = *heap[count];
        place(hole, last);
        rise(hole);
        sink(last.place);
    }

    // Performs the earliest event; there must be one.
    void perform() {
        Event &event = *heap[0];
        const int64_t time = event.time;
        remove(event);
        event.act(event.owner, time);
    }

private:
    Event *heap[CAPACITY];
    int32_t count = 0;
    uint64_t orders = 0;

    void place(int32_t at, Event &event) {
        heap[at] = &event;
        event.place = at;
    }

    bool before(int32_t a, int32_t b) const {
        return heap[a]->time != heap[b]->time ? heap[a]->time < heap[b]->time
                                              : heap[a]->order < heap[b]->order;
    }

    void swap(int32_t a, int32_t b) {
        Event &first = *heap[a], &second = *heap[b];
        place(a, second);
        place(b, first);
    }

    void rise(int32_t at) {
        for (; at && before(at, (at - 1) / 2); at = (at - 1) / 2)
            swap(at, (at - 1) / 2);
    }

    void sink(int32_t at) {
        for (;;) {
            int32_t child = 2 * at + 1;
            if (child >= count) return;
            if (child + 1 < count && before(child + 1, child))
                child++;
            if (!before(child, at)) return;
            swap(at, child);
            at = child;
        }
    }
};

}  // namespace efm32gg
