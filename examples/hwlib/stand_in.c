#include "hwlib.h"

#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <stdio.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#define FAILED (-1)

int32_t uart_init_port(uart_info_t *device)
{
    struct termios settings;
    device->handle = open(device->deviceString, (int)device->access_option | O_NOCTTY);
    if (device->handle < 0 || tcgetattr(device->handle, &settings)) return FAILED;
    cfmakeraw(&settings);
    speed_t speed = device->baud == 115200 ? B115200 : device->baud == 57600 ? B57600 : B9600;
    cfsetispeed(&settings, speed);
    cfsetospeed(&settings, speed);
    return tcsetattr(device->handle, TCSANOW, &settings) ? FAILED : UART_SUCCESS;
}

int32_t uart_bytes_available(uart_info_t *device)
{
    int count = 0;
    return ioctl(device->handle, FIONREAD, &count) ? FAILED : count;
}

int32_t uart_read_port(uart_info_t *device, uint8_t data[], const uint32_t numBytes)
{
    return (int32_t)read(device->handle, data, numBytes);
}

int32_t uart_write_port(uart_info_t *device, uint8_t data[], const uint32_t numBytes)
{
    return (int32_t)write(device->handle, data, numBytes);
}

int32_t uart_close_port(uart_info_t *device) { return close(device->handle); }

int32_t i2c_master_init(i2c_bus_info_t *device)
{
    char path[32];
    snprintf(path, sizeof path, "/dev/i2c-%d", (int)device->handle);
    device->handle = open(path, O_RDWR);
    return device->handle < 0 ? FAILED : I2C_SUCCESS;
}

int32_t i2c_master_transaction(
    i2c_bus_info_t *device, uint8_t addr, void *txbuf, uint8_t txlen, void *rxbuf, uint8_t rxlen,
    uint16_t timeout)
{
    struct i2c_msg messages[2] = {{addr, 0, txlen, txbuf}, {addr, I2C_M_RD, rxlen, rxbuf}};
    struct i2c_rdwr_ioctl_data transfer = {messages + !txlen, (unsigned)!!txlen + !!rxlen};
    if (ioctl(device->handle, I2C_TIMEOUT, (long)timeout)) return FAILED;
    return ioctl(device->handle, I2C_RDWR, &transfer) < 0 ? FAILED : I2C_SUCCESS;
}

int32_t i2c_master_close(i2c_bus_info_t *device) { return close(device->handle); }
