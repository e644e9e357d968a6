/* A flight-style driver of a CubeStar in C, with nothing but POSIX: cc -o flight_driver flight_driver.c
 *
 *   flight_driver /dev/ttyUSB0
 *
 * Frames of the node protocol: 1F 7F, payload with every 1F doubled, 1F FF. A telecommand is answered
 * by one error byte, telemetry by its data. Every request ends after TIMEOUT_MS at the latest.
 * Telemetry requests are repeated; telecommands are not, because they may have been executed.
 */
#define _DEFAULT_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { ESCAPE = 0x1F, START = 0x7F, END = 0xFF };
enum { TC_CAPTURE_AND_PROCESS = 36, TM_PROCESSED = 131, TM_TASK_STATUS = 132, TM_ATTITUDE = 177 };
enum { STATUS_CALCULATED = 29 };
enum { TIMEOUT_MS = 500, RETRIES = 5, LONGEST = 256 };

static int64_t now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static int open_port(const char *path) {
    int port = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (port < 0)
        return -1;
    struct termios settings;
    if (tcgetattr(port, &settings) < 0)
        return -1;
    cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    cfsetspeed(&settings, B57600);
    if (tcsetattr(port, TCSANOW, &settings) < 0)
        return -1;
    tcflush(port, TCIOFLUSH);
    return port;
}

static int send_frame(int port, uint8_t identifier) {
    const uint8_t frame[] = {ESCAPE, START, identifier, ESCAPE, END};
    return write(port, frame, sizeof frame) == sizeof frame ? 0 : -1;
}

/* Stores the payload of the next frame; returns its length, or -1 after the time-out. */
static int receive_frame(int port, uint8_t *payload) {
    enum { OUTSIDE, OUTSIDE_ESCAPED, INSIDE, INSIDE_ESCAPED } state = OUTSIDE;
    const int64_t deadline = now_ms() + TIMEOUT_MS;
    int length = 0;
    for (;;) {
        struct pollfd waiting = {.fd = port, .events = POLLIN};
        const int64_t left = deadline - now_ms();
        if (left <= 0 || poll(&waiting, 1, (int)left) <= 0)
            return -1;
        uint8_t byte;
        if (read(port, &byte, 1) != 1)
            return -1;
        if (state == OUTSIDE) {
            if (byte == ESCAPE)
                state = OUTSIDE_ESCAPED;
        } else if (state == OUTSIDE_ESCAPED || (state == INSIDE_ESCAPED && byte == START)) {
            length = 0;
            if (byte != ESCAPE || state == INSIDE_ESCAPED)
                state = byte == START ? INSIDE : OUTSIDE;
        } else if (state == INSIDE && byte == ESCAPE) {
            state = INSIDE_ESCAPED;
        } else if (state == INSIDE_ESCAPED && byte == END) {
            return length;
        } else if (state == INSIDE_ESCAPED && byte != ESCAPE) {
            state = OUTSIDE;
        } else {
            state = INSIDE;
            if (length < LONGEST)
                payload[length++] = byte;
        }
    }
}

/* Telemetry of exactly `length` bytes; 0, or -1 after all attempts. */
static int telemetry(int port, uint8_t identifier, uint8_t *data, int length) {
    for (int attempt = 0; attempt < RETRIES; attempt++) {
        uint8_t payload[LONGEST];
        tcflush(port, TCIFLUSH);
        if (send_frame(port, identifier) == 0 && receive_frame(port, payload) == length) {
            memcpy(data, payload, (size_t)length);
            return 0;
        }
    }
    return -1;
}

static int fail(const char *what) {
    fprintf(stderr, "flight_driver: %s\n", what);
    return 1;
}

int main(int count, char **arguments) {
    if (count != 2)
        return fail("give the path of a serial port") + 1;
    const int port = open_port(arguments[1]);
    if (port < 0)
        return fail(strerror(errno));
    uint8_t data[LONGEST];
    if (send_frame(port, TC_CAPTURE_AND_PROCESS) < 0)
        return fail("can not write");
    if (receive_frame(port, data) != 1)
        fprintf(stderr, "flight_driver: no acknowledge; was it executed?\n");
    else if (data[0] != 0)
        return fail("CaptureAndProcess was refused");
    for (int polls = 0;; polls++) {
        if (telemetry(port, TM_PROCESSED, data, 1) < 0)
            return fail("no answer to TcmdProcessed");
        if (data[0])
            break;
        if (polls == 100)
            return fail("CaptureAndProcess does not end");
        nanosleep(&(struct timespec){.tv_nsec = 100 * 1000 * 1000}, NULL);
    }
    if (telemetry(port, TM_TASK_STATUS, data, 1) < 0)
        return fail("no answer to TaskStatus");
    if (data[0] != STATUS_CALCULATED)
        return fail("no attitude in this picture");
    if (telemetry(port, TM_ATTITUDE, data, 18) < 0)
        return fail("no answer to AttitudeData");
    for (int index = 0; index < 4; index++) {
        const int16_t raw = (int16_t)(data[2 * index] | data[2 * index + 1] << 8);
        printf("%+.4f%c", raw / 10000.0, index < 3 ? ' ' : '\n');
    }
    close(port);
    return 0;
}
