// RUN, STORE and READ of the reference model of a board (tests/hdl/harness/devboard_model.py), around
// a compiled design: quick enough for images of full size.

#include <cstdint>
#include <initializer_list>

namespace {

typedef unsigned __int128 Word;

// A word in a structure that Python shares.
struct Shared {
    uint64_t low, high;
    operator Word() const { return Word(high) << 64 | low; }
    Shared &operator=(Word word) {
        low = uint64_t(word);
        high = uint64_t(word >> 64);
        return *this;
    }
};

struct Port {
    int32_t pin, offset, width;
};

struct Memory {
    Port address, data_out, drives, ce_n, oe_n, we_n;
    int32_t data_in;
};

struct Setup {
    void *handle;
    void (*set)(void *, int32_t, uint32_t, int64_t);
    uint32_t (*get)(void *, int32_t);
    Port outputs[40];
    Memory memories[2];
    Port data;  // the output that READ predicts
    int32_t output_count, memory_count, size, room;
    Shared values, acknowledges;
};

struct State {
    Shared now, after[2];
    int64_t done, length;
    uint8_t records[1024];
};

enum Status { OK, ACKNOWLEDGE, READS, ADDRESS, CHECK, FULL };

uint64_t level(Word outputs, const Port &port) {
    return uint64_t(outputs >> port.offset) & ((uint64_t(1) << port.width) - 1);
}

Word put(Word outputs, const Port &port, uint64_t value) {
    const Word mask = (Word(1) << port.width) - 1;
    return (outputs & ~(mask << port.offset)) | ((value & mask) << port.offset);
}

struct Board {
    const Setup &setup;
    State &state;

    void set(int32_t pin, uint32_t value) { setup.set(setup.handle, pin, value, 0); }
    uint32_t get(int32_t pin) { return setup.get(setup.handle, pin); }

    Word outputs() {
        Word found = 0;
        for (int32_t n = 0; n < setup.output_count; n++)
            found |= Word(get(setup.outputs[n].pin)) << setup.outputs[n].offset;
        return found;
    }

    Word predicted(bool rising) const {
        return (Word(state.now) & Word(setup.values)) | Word(state.after[rising]);
    }

    void edge(int64_t position, bool rising, Word predicted, Word found) {
        uint8_t *const begin = state.records + state.length, *end = begin;
        for (int32_t number = 0; number < setup.size; number++) {
            const uint8_t byte = uint8_t(found >> (8 * number));
            if (byte == uint8_t(predicted >> (8 * number)))
                continue;
            if (end == begin) {
                *end++ = uint8_t(position);
                *end++ = uint8_t(position >> 8);
            }
            *end++ = uint8_t(number);
            *end++ = byte;
        }
        if (end != begin)
            *end++ = 0xFF;
        state.length = end - state.records;
        state.now = found;
        state.after[rising] = found & ~Word(setup.values);
        state.done = position + 1;
    }

    bool reads(Word found) const {
        for (int32_t n = 0; n < setup.memory_count; n++) {
            const Memory &memory = setup.memories[n];
            if (!level(found, memory.ce_n) && !level(found, memory.oe_n) && level(found, memory.we_n))
                return true;
        }
        return false;
    }

    void follow_bus() {
        const Word found = outputs();
        for (int32_t n = 0; n < setup.memory_count; n++) {
            const Memory &memory = setup.memories[n];
            const uint32_t byte = level(found, memory.drives) ? level(found, memory.data_out) : 0;
            if (get(memory.data_in) != byte)
                set(memory.data_in, byte);
        }
    }
};

}  // namespace

extern "C" int32_t board_clocks(const Setup *setup, State *state, int32_t clock, int32_t data,
                                int32_t line, int32_t number, int32_t high, const uint8_t *pixels,
                                int64_t count) {
    Board board{*setup, *state};
    const Memory &memory = setup->memories[number];
    for (int64_t n = 0; n < count; n++) {
        for (const bool rising : {true, false}) {
            Word predicted = board.predicted(rising);
            if (rising) {
                const uint64_t stored = level(state->after[1], memory.drives) & 1;
                const uint64_t address = level(state->now, memory.address) + stored;
                predicted = put(predicted, memory.address, address);
                predicted = put(predicted, memory.data_out, board.get(data));
                board.set(clock, 1);
            } else {
                board.set(data, pixels[n]);
                board.set(line, high);
                board.set(clock, 0);
            }
            const Word before = state->now;
            board.follow_bus();
            const Word found = board.outputs();
            board.edge(2 * n + !rising, rising, predicted, found);
            if ((found ^ before) & Word(setup->acknowledges))
                return ACKNOWLEDGE;
            if (board.reads(found))
                return READS;
        }
        if (state->length > setup->room && n + 1 < count)
            return FULL;
    }
    return OK;
}

extern "C" int32_t board_read(const Setup *setup, State *state, int32_t clock, int32_t number,
                              int32_t step, const uint8_t *bytes, int64_t count) {
    Board board{*setup, *state};
    const Memory &memory = setup->memories[number];
    for (int64_t n = 0; n < count; n++) {
        for (const bool rising : {true, false}) {
            Word predicted = board.predicted(rising);
            if (rising) {
                const uint64_t address = level(state->now, memory.address) + step;
                predicted = put(predicted, memory.address, address);
                predicted = put(predicted, setup->data, board.get(memory.data_in));
            }
            board.set(clock, rising);
            const uint64_t address = level(predicted, memory.address);
            if (rising && board.get(memory.address.pin) == address)
                board.set(memory.data_in, bytes[n]);
            const Word found = board.outputs();
            board.edge(2 * n + !rising, rising, predicted, found);
            if (level(found, memory.address) != address)
                return ADDRESS;
        }
        if (state->length > setup->room && n + 1 < count)
            return FULL;
    }
    return OK;
}
