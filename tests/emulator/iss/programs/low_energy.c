// Sleeps in EM2 until RTC or LETIMER wakes it.
#include "device.h"

static volatile uint32_t rtc_wakes, letimer_wakes;

void RTC_IRQHandler(void) {
    RTC->IFC = 2;
    rtc_wakes++;
}

void LETIMER0_IRQHandler(void) {
    LETIMER0->IFC = 4;
    letimer_wakes++;
}

int main(void) {
    console_init();
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    CMU->OSCENCMD = CMU_OSCENCMD_LFXOEN;
    while (!(CMU->STATUS & CMU_STATUS_LFXORDY)) ;
    CMU->LFCLKSEL = (CMU->LFCLKSEL & ~3UL) | 2;  // LFXO to the A branch
    CMU->LFACLKEN0 |= CMU_LFACLKEN0_RTC | CMU_LFACLKEN0_LETIMER0;
    while (CMU->SYNCBUSY) ;
    RTC->COMP0 = 32768 / 10 - 1;
    while (RTC->SYNCBUSY) ;
    RTC->IFC = 7;
    RTC->IEN = 2;
    NVIC_EnableIRQ(RTC_IRQn);
    LETIMER0->COMP0 = 32768 / 4 - 1;
    LETIMER0->IFC = 0x1F;
    LETIMER0->IEN = 4;                  // underflow
    LETIMER0->CTRL = 1UL << 9;          // COMP0 is the top
    while (LETIMER0->SYNCBUSY) ;
    NVIC_EnableIRQ(LETIMER0_IRQn);
    RTC->CTRL = 1 | 1 << 2;             // COMP0 is the top
    LETIMER0->CMD = 1;
    SCB->SCR = 1UL << 2;                // deep sleep
    while (rtc_wakes < 10) {
        __WFI();
        // Deep sleep has stopped the crystal.
        CMU->OSCENCMD = CMU_OSCENCMD_HFXOEN;
        while (!(CMU->STATUS & CMU_STATUS_HFXORDY)) ;
        CMU->CMD = CMU_CMD_HFCLKSEL_HFXO;
    }
    console_write("rtc ");
    console_hex(rtc_wakes);
    console_write(" letimer ");
    console_hex(letimer_wakes);
    console_write("\n");
    while (!(UART0->STATUS & USART_STATUS_TXC)) ;
    __disable_irq();
    SCB->SCR = 0;
    for (;;)
        __WFI();
}
