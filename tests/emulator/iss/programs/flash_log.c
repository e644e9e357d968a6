// Keeps a boot counter in flash: erases a page and writes words by a function that runs from RAM.
#include "device.h"

#define PAGE 0x000FF000UL
#define WORDS 8

__attribute__((section(".ramfunc"), noinline, long_call)) static int write_page(const uint32_t *words) {
    MSC->LOCK = 0x1B71;
    MSC->WRITECTRL |= 1;
    MSC->ADDRB = PAGE;
    MSC->WRITECMD = 1;
    if (MSC->STATUS & (2 | 4))
        return -1;
    MSC->WRITECMD = 2;
    while (MSC->STATUS & 1) ;
    for (int i = 0; i < WORDS; i++) {
        MSC->ADDRB = PAGE + 4UL * (uint32_t)i;
        MSC->WRITECMD = 1;
        while (!(MSC->STATUS & 8)) ;
        MSC->WDATA = words[i];
        MSC->WRITECMD = 8;
        while (MSC->STATUS & 1) ;
    }
    MSC->WRITECTRL &= ~1UL;
    MSC->LOCK = 0;
    return 0;
}

int main(void) {
    console_init();
    const volatile uint32_t *page = (const volatile uint32_t *)PAGE;
    uint32_t words[WORDS];
    const uint32_t boots = page[0] == 0xFFFFFFFF ? 1 : page[0] + 1;
    for (uint32_t i = 0; i < WORDS; i++)
        words[i] = boots + i * 0x01010101;
    const int failed = write_page(words);
    int same = 1;
    for (uint32_t i = 0; i < WORDS; i++)
        same &= page[i] == words[i];
    console_write(failed ? "locked" : same ? "boot " : "differs ");
    console_hex(page[0]);
    console_write("\n");
    while (!(UART0->STATUS & USART_STATUS_TXC)) ;
    if (boots < 3)
        SCB->AIRCR = 0x05FA0004;
    for (;;)
        __WFI();
}
