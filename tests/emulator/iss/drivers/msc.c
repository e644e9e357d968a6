// Flash by interrupt: a page erased and words written; a second write only clears bits.
#include "driver.h"

#define PAGE ((volatile uint32_t *)0x000FE000UL)
enum { ERASED = 1, WRITTEN = 2, LOCK_KEY = 0x1B71 };

static volatile uint32_t flags;

void MSC_IRQHandler(void) {
    const uint32_t now = MSC->IF;
    MSC->IFC = now;
    flags |= now;
}

static void wait(uint32_t flag) {
    while (!(flags & flag)) ;
    flags = 0;
}

static void msc_init(void) {
    MSC->LOCK = LOCK_KEY;
    MSC->WRITECTRL = 1;
    MSC->IFC = 3;
    MSC->IEN = 3;
    NVIC_EnableIRQ(MSC_IRQn);
}

static void set_address(volatile uint32_t *to) {
    MSC->ADDRB = (uint32_t)to;
    MSC->WRITECMD = 1;
    check("address", MSC->STATUS & 6, 0);
}

static void erase(volatile uint32_t *page) {
    set_address(page);
    MSC->WRITECMD = 2;
    wait(ERASED);
}

static void write(volatile uint32_t *to, uint32_t word) {
    set_address(to);
    while (!(MSC->STATUS & 8)) ;
    MSC->WDATA = word;
    MSC->WRITECMD = 8;
    wait(WRITTEN);
}

int main(void) {
    driver_begin();
    msc_init();
    erase(PAGE);
    const uint32_t began = CYCCNT;
    for (uint32_t i = 0; i < 8; i++)
        write(&PAGE[i], 0xF0F00000UL + i * 0x01010101UL);
    check_near("time of a word", (CYCCNT - began) / 8, CORE_HZ / 50000, CORE_HZ / 50000);
    write(&PAGE[3], PAGE[3] & 0xFF00FF00);
    for (uint32_t i = 0; i < 8; i++)
        check("word", PAGE[i],
            (0xF0F00000UL + i * 0x01010101UL) & (i == 3 ? 0xFF00FF00 : 0xFFFFFFFF));
    check("beyond", PAGE[8], 0xFFFFFFFF);
    erase(PAGE);
    check("erased", PAGE[3], 0xFFFFFFFF);
    MSC->LOCK = 0;
    MSC->WRITECTRL = 0;
    driver_end();
}
