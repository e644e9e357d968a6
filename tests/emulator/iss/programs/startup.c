// Start-up as vendors write it: weak handlers, vector table, .data and .bss.
#include "device.h"

extern uint32_t __etext, __data_start__, __data_end__, __bss_start__, __bss_end__, __StackTop;
int main(void);

void Default_Handler(void) { for (;;) ; }

void Reset_Handler(void) {
    const uint32_t *source = &__etext;
    for (uint32_t *target = &__data_start__; target < &__data_end__;)
        *target++ = *source++;
    for (uint32_t *target = &__bss_start__; target < &__bss_end__;)
        *target++ = 0;
    SystemInit();
    main();
    Default_Handler();
}

#define WEAK(handler) __attribute__((weak, alias("Default_Handler"))) void handler(void);
WEAK(NMI_Handler) WEAK(HardFault_Handler) WEAK(MemManage_Handler) WEAK(BusFault_Handler)
WEAK(UsageFault_Handler) WEAK(SVC_Handler) WEAK(PendSV_Handler) WEAK(SysTick_Handler)
WEAK(DMA_IRQHandler) WEAK(I2C0_IRQHandler) WEAK(UART0_RX_IRQHandler) WEAK(LETIMER0_IRQHandler)
WEAK(RTC_IRQHandler) WEAK(BURTC_IRQHandler)
WEAK(ADC0_IRQHandler) WEAK(ACMP0_IRQHandler) WEAK(LESENSE_IRQHandler) WEAK(LEUART0_IRQHandler)
WEAK(PCNT0_IRQHandler) WEAK(VCMP_IRQHandler) WEAK(MSC_IRQHandler) WEAK(AES_IRQHandler)

#define IRQ(unit) [16 + unit##_IRQn] = unit##_IRQHandler
__attribute__((section(".isr_vector"), used)) void (*const vectors[16 + 39])(void) = {
    (void (*)(void))&__StackTop, Reset_Handler, NMI_Handler, HardFault_Handler, MemManage_Handler,
    BusFault_Handler, UsageFault_Handler, [11] = SVC_Handler, [14] = PendSV_Handler,
    [15] = SysTick_Handler, IRQ(DMA), IRQ(I2C0), IRQ(UART0_RX), IRQ(LETIMER0), IRQ(RTC),
    IRQ(BURTC), IRQ(ADC0), IRQ(ACMP0), IRQ(LESENSE), IRQ(LEUART0), IRQ(PCNT0), IRQ(VCMP), IRQ(MSC),
    IRQ(AES),
};

void SystemInit(void) {
    MSC->READCTRL = (MSC->READCTRL & ~7UL) | MSC_READCTRL_MODE_WS2;
    // The low-energy bus must be slower than 32 MHz.
    CMU->CTRL |= CMU_CTRL_HFLE;
    CMU->HFCORECLKDIV |= CMU_HFCORECLKDIV_LEDIV4;
    CMU->OSCENCMD = CMU_OSCENCMD_HFXOEN;
    while (!(CMU->STATUS & CMU_STATUS_HFXORDY)) ;
    CMU->CMD = CMU_CMD_HFCLKSEL_HFXO;
    while (!(CMU->STATUS & CMU_STATUS_HFXOSEL)) ;
    CMU->OSCENCMD = CMU_OSCENCMD_HFRCODIS;
}

void console_init(void) {
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_GPIO | CMU_HFPERCLKEN0_UART0;
    GPIO->P[4].DOUTSET = 1;
    GPIO->P[4].MODEL = (GPIO->P[4].MODEL & ~0xFFUL) | 4 | 1 << 4;  // PE0 push-pull, PE1 input
    UART0->FRAME = 5 | 1 << 12;
    UART0->CLKDIV = (256UL * (48000000UL * 4 / (16 * 115200UL) - 4) / 4) & 0x1FFFC0;
    UART0->ROUTE = 1 | 2 | 1 << 8;  // both pins at location 1
    UART0->CMD = USART_CMD_RXEN | USART_CMD_TXEN;
}

void console_put(char c) {
    while (!(UART0->STATUS & USART_STATUS_TXBL)) ;
    UART0->TXDATA = (uint8_t)c;
}

void console_write(const char *text) {
    while (*text)
        console_put(*text++);
}

void console_hex(uint32_t value) {
    for (int shift = 28; shift >= 0; shift -= 4)
        console_put("0123456789abcdef"[value >> shift & 15]);
}
