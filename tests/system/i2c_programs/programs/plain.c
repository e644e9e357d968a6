/* Reads telemetry 128 by I2C_RDWR, 131 by I2C_SMBUS, and an address without a device. */

#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>

int main(int count, char **words)
{
    int fd = open(words[count - 1], O_RDWR);
    unsigned char id = 0x80, data[4];
    struct i2c_msg messages[2] = {{0x1a, 0, 1, &id}, {0x1a, I2C_M_RD, 4, data}};
    struct i2c_rdwr_ioctl_data transfer = {messages, 2};
    if (fd < 0 || ioctl(fd, I2C_RDWR, &transfer) != 2) return 1;
    printf("%02x%02x%02x%02x", data[0], data[1], data[2], data[3]);
    union i2c_smbus_data byte;
    struct i2c_smbus_ioctl_data read = {I2C_SMBUS_READ, 0x83, I2C_SMBUS_BYTE_DATA, &byte};
    if (ioctl(fd, I2C_SLAVE, 0x1a) || ioctl(fd, I2C_SMBUS, &read)) return 1;
    printf(" %02x", byte.byte);
    ioctl(fd, I2C_SLAVE, 0x33);
    puts(ioctl(fd, I2C_SMBUS, &read) && errno == ENXIO ? " absent" : " present");
    return 0;
}
