// I2C master by interrupt: writes and reads a device's registers; at another address is nobody.
#include "driver.h"

enum { START = 1, STOP = 2, ACK = 4, NACK = 8, ABORT = 32 };
enum { F_RXDATAV = 1 << 5, F_ACK = 1 << 6, F_NACK = 1 << 7, F_MSTOP = 1 << 8, F_LOST = 3 << 9 };
typedef enum { BUSY, DONE, NO_ANSWER, LOST } Result;

typedef struct {
    uint8_t address;
    const uint8_t *write;
    uint8_t *read;
    uint32_t to_write, to_read;
} I2C_Transfer;

static I2C_Transfer now;
static bool reading, refused;
static volatile Result result;

void I2C0_IRQHandler(void) {
    const uint32_t flags = I2C0->IF & I2C0->IEN;
    I2C0->IFC = flags & ~(uint32_t)F_RXDATAV;
    if (flags & F_LOST) {
        result = LOST;
    } else if (flags & F_NACK) {
        refused = true;
        I2C0->CMD = STOP;
    } else if (flags & F_RXDATAV) {
        *now.read++ = (uint8_t)I2C0->RXDATA;
        I2C0->CMD = --now.to_read ? ACK : NACK;
        if (!now.to_read)
            I2C0->CMD = STOP;
    } else if (flags & F_ACK && !reading) {
        if (now.to_write) {
            now.to_write--;
            I2C0->TXDATA = *now.write++;
        } else if (now.to_read) {
            reading = true;
            I2C0->CMD = START;
            I2C0->TXDATA = now.address | 1;
        } else {
            I2C0->CMD = STOP;
        }
    }
    if (flags & F_MSTOP)
        result = refused ? NO_ANSWER : DONE;
}

static void i2c_init(void) {
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_I2C0 | CMU_HFPERCLKEN0_GPIO;
    GPIO->P[3].DOUTSET = 3UL << 14;
    GPIO->P[3].MODEH = (GPIO->P[3].MODEH & 0x00FFFFFF) | 0x88000000;  // PD14, PD15: open drain
    I2C0->CLKDIV = 59;  // 100 kHz
    I2C0->ROUTE = 3 | 3UL << 8;
    I2C0->CTRL = 1;
    I2C0->CMD = ABORT;
    I2C0->IFC = 0x1FFCF;
    I2C0->IEN = F_RXDATAV | F_ACK | F_NACK | F_MSTOP | F_LOST;
    NVIC_EnableIRQ(I2C0_IRQn);
}

static Result transfer(uint8_t address, const uint8_t *write, uint32_t to_write, uint8_t *read,
    uint32_t to_read) {
    now = (I2C_Transfer){address, write, read, to_write, to_read};
    reading = refused = false;
    result = BUSY;
    I2C0->TXDATA = address;
    I2C0->CMD = START;
    SLEEP_UNTIL(result != BUSY);
    return result;
}

int main(void) {
    static const uint8_t SET[] = {0x10, 0xDE, 0xAD, 0xBE, 0xEF};
    static const uint8_t AT[] = {0x11};
    uint8_t found[3];
    driver_begin();
    i2c_init();
    check("nobody", transfer(0x42, SET, 2, 0, 0), NO_ANSWER);
    check("write", transfer(0xA0, SET, sizeof SET, 0, 0), DONE);
    check("read", transfer(0xA0, AT, 1, found, sizeof found), DONE);
    for (unsigned i = 0; i < sizeof found; i++)
        check("byte", found[i], SET[2 + i]);
    check("nobody again", transfer(0x42, AT, 1, 0, 0), NO_ANSWER);
    driver_end();
}
