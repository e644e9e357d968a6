// What a debugger's session needs: calls, a loop, a structure, an interrupt, and the FPGA at work.
#include "board.h"

struct point {
    int x, y;
};

volatile uint32_t ticks, total, writes, pictures;
struct point place;

void systick_handler(void) { ticks++; }

int square(int value) {
    int result = value * value;
    return result;
}

int sum_of_squares(int count) {
    int sum = 0;
    for (int i = 1; i <= count; i++)
        sum += square(i);
    return sum;    // the loop has ended
}

void set_total(uint32_t value) {
    total = value;
    writes++;
}

static void take_pictures(void) {
    if (!get(FPGA_ACK))
        return;
    set(FPGA_ENABLE, 0);
    set(FPGA_ENABLE, 1);
    pictures++;
}

int main(void) {
    start_board();
    *(volatile uint32_t *)0xE000E014 = 47999;
    *(volatile uint32_t *)0xE000E018 = 0;
    *(volatile uint32_t *)0xE000E010 = 7;
    place = (struct point){3, 4};
    set(FPGA_ENABLE, 1);
    for (;;) {
        set_total(sum_of_squares(4));    // again and again
        take_pictures();
    }
}
