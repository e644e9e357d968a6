// Is reset by the watchdog again and again; prints the cause of each reset.
#include "device.h"

int main(void) {
    console_init();
    const uint32_t cause = RMU->RSTCAUSE;
    RMU->CMD = 1;
    console_write("cause ");
    console_hex(cause);
    console_put('\n');
    while (!(UART0->STATUS & USART_STATUS_TXC)) ;
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    // 1 kHz oscillator, 2^(3+4)+1 periods: about 0.13 s.
    WDOG->CTRL = 1 | 4UL << 8 | 0UL << 12;
    while (WDOG->SYNCBUSY) ;
    for (;;) ;
}
