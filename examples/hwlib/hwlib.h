/* Stand-in for the part of NASA's hwlib that star_tracker.c uses: names and types of its libuart.h and
 * libi2c.h, implemented in stand_in.c with plain Linux calls. With hwlib itself, leave out both. */

#include <stdint.h>

#define UART_SUCCESS 0
#define I2C_SUCCESS 0

typedef enum { uart_access_flag_RDONLY, uart_access_flag_WRONLY, uart_access_flag_RDWR } uart_access_flag;

typedef struct {
    const char *deviceString;
    int32_t handle;
    uint32_t baud;
    uart_access_flag access_option;
} uart_info_t;

typedef struct {
    int32_t handle; /* number of the bus, then its descriptor */
    int32_t addr;
    uint16_t speed;
} i2c_bus_info_t;

int32_t uart_init_port(uart_info_t *device);
int32_t uart_bytes_available(uart_info_t *device);
int32_t uart_read_port(uart_info_t *device, uint8_t data[], const uint32_t numBytes);
int32_t uart_write_port(uart_info_t *device, uint8_t data[], const uint32_t numBytes);
int32_t uart_close_port(uart_info_t *device);

int32_t i2c_master_init(i2c_bus_info_t *device);
int32_t i2c_master_transaction(
    i2c_bus_info_t *device, uint8_t addr, void *txbuf, uint8_t txlen, void *rxbuf, uint8_t rxlen,
    uint16_t timeout);
int32_t i2c_master_close(i2c_bus_info_t *device);
