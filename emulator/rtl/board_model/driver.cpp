// The serial line of a simulated board.
//
// board.h declares struct Board: `rx` and `tx` are the levels of the line, and clock() runs one
// clock of the bridge and returns whether any register changed. A board whose registers stay the
// same at the same levels of its inputs is idle: further clocks change nothing and are skipped.

#include <cstdint>
#include <cstddef>

#include "board.h"

namespace {

class Line {
public:
    explicit Line(int divider) : divider(divider) { board.rx = true; }

    // Sends `count` bytes and returns the number of bytes received, at most `room`. Ends when all
    // is sent and the board is idle, or when there is no more room, or after `most` clocks.
    // `sent` is set to the number of bytes sent.
    int64_t run(const uint8_t *bytes, int64_t count, uint8_t *received, int64_t room, int64_t most,
                int64_t *sent) {
        int64_t found = 0, at = 0;
        int quiet = 0;
        for (int64_t n = 0; n < most && found < room; n++) {
            if (!left && at < count) {
                shift = 0x200u | (unsigned)bytes[at++] << 1;
                left = 10 * divider;
            }
            if (left) {
                board.rx = shift >> (10 - (left + divider - 1) / divider) & 1;
                left--;
                quiet = 0;
            } else {
                board.rx = true;
            }
            const bool changed = board.clock();
            clocks++;
            if (receive())
                received[found++] = byte;
            quiet = changed || timer ? 0 : quiet + 1;
            if (quiet > 4 && !left && at == count)
                break;
        }
        *sent = at;
        return found;
    }

    Board board;
    int64_t clocks = 0;

private:
    // Samples the board's line in the middle of each bit; returns whether a byte is complete.
    bool receive() {
        if (!timer) {
            if (!board.tx) {
                timer = divider / 2 + divider;
                bits = 0;
            }
            return false;
        }
        if (--timer)
            return false;
        if (bits == 8)
            return board.tx;
        byte = (uint8_t)(byte >> 1 | (board.tx ? 0x80 : 0));
        bits++;
        timer = divider;
        return false;
    }

    const int divider;
    unsigned shift = 0;
    int left = 0, timer = 0, bits = 0;
    uint8_t byte = 0;
};

}  // namespace

extern "C" {

Line *board_new(int32_t divider) { return new Line(divider); }
void board_delete(Line *line) { delete line; }
int64_t board_clocks(const Line *line) { return line->clocks; }
int64_t board_run(Line *line, const uint8_t *bytes, int64_t count, uint8_t *received, int64_t room,
                  int64_t most, int64_t *sent) {
    return line->run(bytes, count, received, room, most, sent);
}
}
