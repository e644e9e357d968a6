// Schedule of events by time in picoseconds; equal ones in the order in which they were scheduled. An
// event belongs to its peripheral and is in the schedule at most once.
#pragma once

#include <cstdint>

namespace efm32gg {

constexpr int64_t SECOND = 1000000000000, MILLISECOND = SECOND / 1000,
                  MICROSECOND = MILLISECOND / 1000, NANOSECOND = 1000;
constexpr int64_t NEVER = INT64_MAX;

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

// A binary heap; each event stores its place in it.
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
