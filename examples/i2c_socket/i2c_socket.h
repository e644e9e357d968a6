/* Client of an emulated I2C bus: the protocol of docs/reference/i2c-socket.md, version 1.
 *
 * All functions return 0 or more, or a negative errno: -ENXIO if no device has the address, -EIO if a
 * byte was not acknowledged or the emulation has ended. A connection is for one thread at a time. */

#include <stddef.h>
#include <stdint.h>

#define I2C_SOCKET_READ 1 /* flag of a message that reads */

struct i2c_socket_message {
    uint16_t address; /* 7 bits */
    uint16_t flags;   /* 0 writes */
    uint16_t length;  /* bytes in data, at most 8192 */
    uint8_t *data;
};

/* Connects to a bus; targets receives what is on it, one device a line. Returns the connection. */
int i2c_socket_open(const char *path, char *targets, size_t size);

/* One transfer, with repeated starts between its 1 to 42 messages. Returns their number. */
int i2c_socket_transfer(int bus, const struct i2c_socket_message *messages, int count);
