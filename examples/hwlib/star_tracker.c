/* Reads a star tracker's identification over the calls of NASA's hwlib, as a component of NOS3 does:
 * star_tracker PORT for its serial line, star_tracker BUS for its I2C bus. */

#include "hwlib.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { ADDRESS = 0x1A, IDENTIFICATION = 0x80, ANSWER_BYTES = 8, POLL_US = 1000, POLLS = 5000 };

static int read_on_uart(const char *port, uint8_t *answer)
{
    uart_info_t uart = {.deviceString = port, .baud = 57600, .access_option = uart_access_flag_RDWR};
    uint8_t request[] = {0x1F, 0x7F, IDENTIFICATION, 0x1F, 0xFF}, frame[4 + ANSWER_BYTES];
    if (uart_init_port(&uart) != UART_SUCCESS) return -1;
    int status = uart_write_port(&uart, request, sizeof request) == sizeof request ? 0 : -1;
    for (int polls = 0; !status && uart_bytes_available(&uart) < (int32_t)sizeof frame; polls++) {
        if (polls == POLLS) status = -1;
        usleep(POLL_US);
    }
    if (!status && uart_read_port(&uart, frame, sizeof frame) != sizeof frame) status = -1;
    for (int i = 0; !status && i < ANSWER_BYTES; i++) answer[i] = frame[2 + i];
    uart_close_port(&uart);
    return status;
}

static int read_on_i2c(int32_t number, uint8_t *answer)
{
    i2c_bus_info_t bus = {.handle = number, .addr = ADDRESS, .speed = 100};
    uint8_t request = IDENTIFICATION;
    if (i2c_master_init(&bus) != I2C_SUCCESS) return -1;
    int32_t status = i2c_master_transaction(&bus, ADDRESS, &request, 1, answer, ANSWER_BYTES, 10);
    i2c_master_close(&bus);
    return status == I2C_SUCCESS ? 0 : -1;
}

int main(int count, char **words)
{
    uint8_t answer[ANSWER_BYTES];
    char *end = NULL;
    long number = count == 2 ? strtol(words[1], &end, 10) : -1;
    if (count != 2) {
        fputs("usage: star_tracker PORT|BUS\n", stderr);
        return 2;
    }
    if (*end ? read_on_uart(words[1], answer) : read_on_i2c((int32_t)number, answer)) {
        fputs("star_tracker: no answer\n", stderr);
        return 1;
    }
    printf("node type %u, interface %u, firmware %u.%u\n", answer[0], answer[1], answer[2], answer[3]);
    return 0;
}
