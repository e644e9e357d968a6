#include "i2c_socket.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { VERSION = 1, HELLO = 0, RDWR = 3, MOST_MESSAGES = 42, MOST_BYTES = 8192 };

struct head { /* of a request; the protocol has no padding */
    uint32_t length; /* of what follows it */
    uint64_t key;
    uint8_t call;
} __attribute__((packed));

struct reply {
    uint32_t length; /* of what follows it */
    int32_t result;
};

static int send_all(int bus, const void *data, size_t count)
{
    while (count) {
        ssize_t sent = send(bus, data, count, MSG_NOSIGNAL);
        if (sent < 0 && errno != EINTR) return -EIO;
        if (sent < 0) continue;
        data = (const char *)data + sent;
        count -= (size_t)sent;
    }
    return 0;
}

static int receive_all(int bus, void *data, size_t count)
{
    while (count) {
        ssize_t got = recv(bus, data, count, 0);
        if (got == 0 || (got < 0 && errno != EINTR)) return -EIO;
        if (got < 0) continue;
        data = (char *)data + got;
        count -= (size_t)got;
    }
    return 0;
}

static int send_request(int bus, uint8_t call, size_t length)
{
    struct head head = {(uint32_t)(sizeof head - sizeof head.length + length), 0, call};
    return send_all(bus, &head, sizeof head);
}

/* Receives a reply's result; left: bytes of data that follow. */
static int receive_result(int bus, size_t *left)
{
    struct reply reply;
    if (receive_all(bus, &reply, sizeof reply)) return -EIO;
    *left = reply.length - sizeof reply.result;
    return reply.result;
}

int i2c_socket_open(const char *path, char *targets, size_t size)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    uint32_t version = VERSION;
    if (!size || strlen(path) >= sizeof address.sun_path) return -EINVAL;
    strcpy(address.sun_path, path);
    int bus = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (bus < 0) return -errno;
    int result = connect(bus, (struct sockaddr *)&address, sizeof address) ? -errno : 0;
    if (!result) result = send_request(bus, HELLO, sizeof version);
    if (!result) result = send_all(bus, &version, sizeof version);
    size_t left = 0;
    if (!result) result = receive_result(bus, &left);
    char end;
    for (size_t used = 0; left; left--) { /* the devices, or why it is refused */
        if (receive_all(bus, &end, 1)) break;
        if (used + 1 < size) targets[used++] = end;
        targets[used] = 0;
    }
    if (result >= 0) return bus;
    close(bus);
    return result;
}

int i2c_socket_transfer(int bus, const struct i2c_socket_message *messages, int count)
{
    size_t length = 0, left;
    if (count < 1 || count > MOST_MESSAGES) return -EINVAL;
    for (int i = 0; i < count; i++) {
        if (messages[i].length > MOST_BYTES) return -EINVAL;
        length += 8 + (messages[i].flags & I2C_SOCKET_READ ? 0 : messages[i].length);
    }
    if (send_request(bus, RDWR, length)) return -EIO;
    for (int i = 0; i < count; i++) {
        const struct i2c_socket_message *one = &messages[i];
        uint16_t sent = one->flags & I2C_SOCKET_READ ? 0 : one->length;
        uint16_t head[4] = {one->address, one->flags, one->length, sent};
        if (send_all(bus, head, sizeof head) || send_all(bus, one->data, sent)) return -EIO;
    }
    int result = receive_result(bus, &left);
    for (int i = 0; i < count && result >= 0; i++)
        if (messages[i].flags & I2C_SOCKET_READ && receive_all(bus, messages[i].data, messages[i].length))
            return -EIO;
    return result;
}
