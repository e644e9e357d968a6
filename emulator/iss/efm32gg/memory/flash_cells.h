// What happens to flash beyond its contents: a log of every change, and worn cells.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

namespace efm32gg {

// A word that was programmed, or pages that were erased; FlashChange in flash_changes.py is the
// same. Contents change at `time`, and the array is busy for `duration` from then on.
struct FlashChange {
    int64_t time, duration;
    uint32_t address, size;
    uint32_t before, after;     // of a word
    uint32_t pc;                // of the instruction that was running at the start
    int32_t erased;             // 0: a word, 1: pages
};
static_assert(sizeof(FlashChange) == 40, "the Python side reads it as 40 bytes");

class FlashCells {
public:
    bool logging = false;
    std::vector<FlashChange> log;

    void note(const FlashChange &change) {
        if (logging)
            log.push_back(change);
    }

    // The bits in `mask` of the word at `address` keep their value for good.
    void wear_out(uint32_t address, uint32_t mask) { worn[address & ~3u] |= mask; }

    // The word that results from changing `before` to `after`.
    uint32_t changed(uint32_t address, uint32_t before, uint32_t after) const {
        if (worn.empty()) return after;
        const auto found = worn.find(address & ~3u);
        const uint32_t kept = found == worn.end() ? 0 : found->second;
        return (before & kept) | (after & ~kept);
    }

private:
    std::unordered_map<uint32_t, uint32_t> worn;
};

}  // namespace efm32gg
