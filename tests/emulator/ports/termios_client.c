/* A host program: termios_client PORT sends all 256 byte values and expects each back. */
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <termios.h>
#include <unistd.h>

int main(int argc, char **argv)
{
    struct termios settings;
    unsigned char sent[256], got[256];
    int count = 0, port = argc == 2 ? open(argv[1], O_RDWR | O_NOCTTY) : -1;
    if (port < 0 || tcgetattr(port, &settings))
        return 2;
    cfmakeraw(&settings);
    cfsetspeed(&settings, B115200);
    if (tcsetattr(port, TCSANOW, &settings))
        return 2;
    for (int i = 0; i < 256; i++)
        sent[i] = (unsigned char)i;
    if (write(port, sent, 256) != 256)
        return 2;
    while (count < 256) {
        struct pollfd wanted = {.fd = port, .events = POLLIN};
        if (poll(&wanted, 1, 20000) != 1)
            return 1;
        count += (int)read(port, got + count, (size_t)(256 - count));
    }
    for (int i = 0; i < 256; i++)
        if (got[i] != i)
            return 1;
    puts("echoed");
    return 0;
}
