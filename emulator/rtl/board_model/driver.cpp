// The serial lines of simulated boards, which run side by side.
//
// board.h declares struct Board: bit n of `rx` and `tx` is the level of the line of board n, its
// lane, and clock() runs one clock of all bridges and returns the lanes in which any register
// changed. A board whose registers stay the same at the same levels of its inputs is idle: further
// clocks change nothing.

#include <cstddef>
#include <cstdint>

#include "board.h"

// A board's line during a call.
struct Lane {
    const uint8_t *bytes;  // to the board
    int64_t count;
    uint8_t *received;     // from the board
    int64_t room;
    int64_t sent, found;   // of these, by this call
    int64_t clocks;        // while not idle, added up
    int32_t busy;          // 1 if it is not idle or has bytes to take, else 0
};

namespace {

class Lines {
public:
    explicit Lines(int divider) : divider(divider) { board.rx = all; }

    // Runs until a busy lane is idle or has no more room, or for `most` clocks.
    void run(Lane *lanes, int count, int64_t most) {
        Bits waiting = 0, busy = 0;
        for (int n = 0; n < count; n++) {
            lanes[n].sent = lanes[n].found = 0;
            waiting |= Bits(lanes[n].count > 0) << n;
            lanes[n].busy |= lanes[n].count > 0;
            busy |= Bits(lanes[n].busy) << n;
        }
        bool room = true;
        int64_t clock = 0;
        Bits idle = 0;
        while (clock < most && room && !(idle & busy)) {
            board.rx = all;
            each(sending | waiting, [&](int n) {
                const Bits lane = Bits(1) << n;
                if (!lines[n].send(lanes[n], divider))
                    board.rx &= ~lane;
                sending = lines[n].left ? sending | lane : sending & ~lane;
                if (lanes[n].sent == lanes[n].count)
                    waiting &= ~lane;
            });
            const Bits changed = board.clock();
            clock++;
            const Bits started = ~board.tx & used(count);
            each(receiving | started, [&](int n) {
                const Bits lane = Bits(1) << n;
                if (lines[n].receive(board.tx >> n & 1, divider)) {
                    lanes[n].received[lanes[n].found++] = lines[n].byte;
                    room &= lanes[n].found < lanes[n].room;
                }
                receiving = lines[n].timer ? receiving | lane : receiving & ~lane;
            });
            const Bits moving = changed | receiving | sending | waiting;
            idle = used(count) & ~(moving | past[0] | past[1] | past[2] | past[3]);
            past[clock & 3] = moving;
        }
        for (int n = 0; n < count; n++) {
            lanes[n].clocks += lanes[n].busy ? clock : 0;
            lanes[n].busy = !(idle >> n & 1);
        }
    }

private:
    struct Line {
        unsigned shift = 0;
        int left = 0, timer = 0, bits = 0;
        uint8_t byte = 0;

        // Level of the line to the board for the next clock.
        bool send(Lane &lane, int divider) {
            if (!left) {
                shift = 0x200u | (unsigned)lane.bytes[lane.sent++] << 1;
                left = 10 * divider;
            }
            const bool level = shift >> (10 - (left + divider - 1) / divider) & 1;
            left--;
            return level;
        }

        // Samples the board's line in the middle of each bit; returns whether a byte is complete.
        bool receive(bool level, int divider) {
            if (!timer) {
                timer = level ? 0 : divider / 2 + divider;
                bits = 0;
                return false;
            }
            if (--timer)
                return false;
            if (bits == 8)
                return level;
            byte = (uint8_t)(byte >> 1 | (level ? 0x80 : 0));
            bits++;
            timer = divider;
            return false;
        }
    };

    static Bits used(int count) { return count == LANES ? all : (Bits(1) << count) - 1; }

    Board board;
    const int divider;
    Line lines[Board::lanes];
    Bits sending = 0, receiving = 0, past[4] = {};
};

}  // namespace

extern "C" {

int32_t board_lanes() { return Board::lanes; }
Lines *board_new(int32_t divider) { return new Lines(divider); }
void board_delete(Lines *lines) { delete lines; }
void board_run(Lines *lines, Lane *lanes, int32_t count, int64_t most) {
    lines->run(lanes, count, most);
}
}
