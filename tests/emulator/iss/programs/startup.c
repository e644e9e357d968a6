// Start-up as vendors write it: weak handlers, a vector table, copy .data, clear .bss.
#include "device.h"

extern uint32_t __etext, __data_start__, __data_end__, __bss_start__, __bss_end__, __StackTop;
int main(void);

void Default_Handler(void) {
    for (;;) {
    }
}

void Reset_Handler(void) {
    const uint32_t *source = &__etext;
    for (uint32_t *target = &__data_start__; target < &__data_end__;)
        *target++ = *source++;
    for (uint32_t *target = &__bss_start__; target < &__bss_end__;)
        *target++ = 0;
    SystemInit();
    main();
    for (;;) {
    }
}

#define WEAK __attribute__((weak, alias("Default_Handler")))
void NMI_Handler(void) WEAK;
void HardFault_Handler(void) WEAK;
void MemManage_Handler(void) WEAK;
void BusFault_Handler(void) WEAK;
void UsageFault_Handler(void) WEAK;
void SVC_Handler(void) WEAK;
void PendSV_Handler(void) WEAK;
void SysTick_Handler(void) WEAK;
void DMA_IRQHandler(void) WEAK;
void I2C0_IRQHandler(void) WEAK;
void UART0_RX_IRQHandler(void) WEAK;
void UART0_TX_IRQHandler(void) WEAK;
void LETIMER0_IRQHandler(void) WEAK;
void RTC_IRQHandler(void) WEAK;

__attribute__((section(".isr_vector"), used)) void (*const vectors[16 + 39])(void) = {
    (void (*)(void))&__StackTop,
    Reset_Handler,
    NMI_Handler,
    HardFault_Handler,
    MemManage_Handler,
    BusFault_Handler,
    UsageFault_Handler,
    [11] = SVC_Handler,
    [14] = PendSV_Handler,
    [15] = SysTick_Handler,
    [16 + DMA_IRQn] = DMA_IRQHandler,
    [16 + I2C0_IRQn] = I2C0_IRQHandler,
    [16 + UART0_RX_IRQn] = UART0_RX_IRQHandler,
    [16 + UART0_TX_IRQn] = UART0_TX_IRQHandler,
    [16 + LETIMER0_IRQn] = LETIMER0_IRQHandler,
    [16 + RTC_IRQn] = RTC_IRQHandler,
};

void SystemInit(void) {
    MSC->READCTRL = (MSC->READCTRL & ~7UL) | MSC_READCTRL_MODE_WS2;
    // The low energy bus is to be slower than 32 MHz.
    CMU->CTRL |= CMU_CTRL_HFLE;
    CMU->HFCORECLKDIV |= CMU_HFCORECLKDIV_LEDIV4;
    CMU->OSCENCMD = CMU_OSCENCMD_HFXOEN;
    while (!(CMU->STATUS & CMU_STATUS_HFXORDY)) {
    }
    CMU->CMD = CMU_CMD_HFCLKSEL_HFXO;
    while (!(CMU->STATUS & CMU_STATUS_HFXOSEL)) {
    }
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
    while (!(UART0->STATUS & USART_STATUS_TXBL)) {
    }
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
