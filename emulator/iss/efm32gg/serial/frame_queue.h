// Buffer of a serial interface: N entries, the oldest first.
#pragma once

#include <cstdint>

namespace efm32gg {

template <int N> class FrameQueue {
public:
    bool empty() const { return !count; }
    bool full() const { return count == N; }
    int size() const { return count; }
    uint32_t front(int index = 0) const { return index < count ? entries[index] : 0; }
    void clear() { count = 0; }
    void push(uint32_t entry) { entries[count++] = entry; }
    // Replaces the newest entry.
    void replace_last(uint32_t entry) { entries[count - 1] = entry; }

    uint32_t pop() {
        const uint32_t entry = front();
        for (int n = 1; n < count; n++)
            entries[n - 1] = entries[n];
        count -= count > 0;
        return entry;
    }

private:
    uint32_t entries[N] = {};
    int count = 0;
};

}  // namespace efm32gg
