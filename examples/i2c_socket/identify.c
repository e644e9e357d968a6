/* Lists the devices on an emulated bus, and reads telemetry 128 of one: identify SOCKET ADDRESS */

#include "i2c_socket.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int count, char **words)
{
    char targets[1024] = "";
    if (count != 3) {
        fputs("usage: identify SOCKET ADDRESS\n", stderr);
        return 2;
    }
    int bus = i2c_socket_open(words[1], targets, sizeof targets);
    if (bus < 0) {
        fprintf(stderr, "identify: %s: %s\n", words[1], *targets ? targets : strerror(-bus));
        return 1;
    }
    fputs(targets, stdout);
    uint8_t id = 128, data[4];
    uint16_t address = (uint16_t)strtoul(words[2], NULL, 0);
    struct i2c_socket_message transfer[] = {
        {address, 0, 1, &id}, {address, I2C_SOCKET_READ, sizeof data, data}};
    int result = i2c_socket_transfer(bus, transfer, 2);
    if (result < 0) {
        fprintf(stderr, "identify: %#x: %s\n", address, strerror(-result));
        return 1;
    }
    printf("%u %u %u %u\n", data[0], data[1], data[2], data[3]);
    return 0;
}
