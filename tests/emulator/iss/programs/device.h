// The EFM32GG as a vendor's device header shows it: struct types for the peripherals.
//
// Written from the reference manual and not from the emulator's tables, so that programs that
// include it find registers at wrong addresses.
#ifndef DEVICE_H
#define DEVICE_H

#include <stdint.h>

#define __IO volatile

typedef struct {
    __IO uint32_t CTRL, HFCORECLKDIV, HFPERCLKDIV, HFRCOCTRL, LFRCOCTRL, AUXHFRCOCTRL, CALCTRL,
        CALCNT, OSCENCMD, CMD, LFCLKSEL, STATUS, IF, IFS, IFC, IEN, HFCORECLKEN0, HFPERCLKEN0,
        RESERVED0[2], SYNCBUSY, FREEZE, LFACLKEN0, RESERVED1, LFBCLKEN0, RESERVED2, LFAPRESC0,
        RESERVED3, LFBPRESC0, RESERVED4, PCNTCTRL, LCDCTRL, ROUTE, LOCK;
} CMU_TypeDef;

typedef struct {
    __IO uint32_t CTRL, MODEL, MODEH, DOUT, DOUTSET, DOUTCLR, DOUTTGL, DIN, PINLOCKN;
} GPIO_P_TypeDef;

typedef struct {
    GPIO_P_TypeDef P[6];
    __IO uint32_t RESERVED0[10], EXTIPSELL, EXTIPSELH, EXTIRISE, EXTIFALL, IEN, IF, IFS, IFC, ROUTE,
        INSENSE, LOCK;
} GPIO_TypeDef;

typedef struct {
    __IO uint32_t CTRL, FRAME, TRIGCTRL, CMD, STATUS, CLKDIV, RXDATAX, RXDATA, RXDOUBLEX, RXDOUBLE,
        RXDATAXP, RXDOUBLEXP, TXDATAX, TXDATA, TXDOUBLEX, TXDOUBLE, IF, IFS, IFC, IEN, IRCTRL,
        ROUTE, INPUT, I2SCTRL;
} USART_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, STATE, STATUS, CLKDIV, SADDR, SADDRMASK, RXDATA, RXDATAP, TXDATA, IF,
        IFS, IFC, IEN, ROUTE;
} I2C_TypeDef;

typedef struct {
    __IO uint32_t CTRL;
} DMA_CH_TypeDef;

typedef struct {
    __IO uint32_t STATUS, CONFIG, CTRLBASE, ALTCTRLBASE, CHWAITSTATUS, CHSWREQ, CHUSEBURSTS,
        CHUSEBURSTC, CHREQMASKS, CHREQMASKC, CHENS, CHENC, CHALTS, CHALTC, CHPRIS, CHPRIC,
        RESERVED0[3], ERRORC, RESERVED1[880], CHREQSTATUS, RESERVED2, CHSREQSTATUS, RESERVED3[121],
        IF, IFS, IFC, IEN, CTRL, RDS, RESERVED4[2], LOOP0, LOOP1, RESERVED5[14], RECT0,
        RESERVED6[39];
    DMA_CH_TypeDef CH[12];
} DMA_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CNT, COMP0, COMP1, IF, IFS, IFC, IEN, FREEZE, SYNCBUSY;
} RTC_TypeDef;

typedef struct {
    __IO uint32_t CTRL, LPMODE, CNT, COMP0, TIMESTAMP, LFXOFDET, STATUS, CMD, POWERDOWN, LOCK, IF,
        IFS, IFC, IEN, FREEZE, SYNCBUSY;
} BURTC_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, STATUS, CNT, COMP0, COMP1, REP0, REP1, IF, IFS, IFC, IEN, FREEZE,
        SYNCBUSY, RESERVED0[2], ROUTE;
} LETIMER_TypeDef;

typedef struct {
    __IO uint32_t CTRL, READCTRL, WRITECTRL, WRITECMD, ADDRB, RESERVED0, WDATA, STATUS,
        RESERVED1[3], IF, IFS, IFC, IEN, LOCK, CMD, CACHEHITS, CACHEMISSES, RESERVED2, TIMEBASE,
        MASSLOCK;
} MSC_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, STATUS, SINGLECTRL, SCANCTRL, IEN, IF, IFS, IFC, SINGLEDATA, SCANDATA,
        SINGLEDATAP, SCANDATAP, CAL, RESERVED0, BIASPROG;
} ADC_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, STATUS, IEN, IF, IFS, IFC, TOP, TOPB, CNT, ROUTE;
} TIMER_TypeDef;

typedef struct {
    __IO uint32_t SWPULSE, SWLEVEL, ROUTE, RESERVED0, CH_CTRL[12];
} PRS_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, SYNCBUSY;
} WDOG_TypeDef;

typedef struct {
    __IO uint32_t CTRL, RSTCAUSE, CMD;
} RMU_TypeDef;

typedef struct {
    __IO uint32_t CTRL, INPUTSEL, STATUS, IEN, IF, IFS, IFC, ROUTE;
} ACMP_TypeDef;

typedef struct {
    __IO uint32_t CTRL, INPUTSEL, STATUS, IEN, IF, IFS, IFC;
} VCMP_TypeDef;

typedef struct {
    __IO uint32_t CTRL, STATUS, CH0CTRL, CH1CTRL, IEN, IF, IFS, IFC, CH0DATA, CH1DATA, COMBDATA,
        CAL, BIASPROG;
} DAC_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, STATUS, CNT, TOP, TOPB, IF, IFS, IFC, IEN, ROUTE, FREEZE, SYNCBUSY;
} PCNT_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, STATUS, CLKDIV, STARTFRAME, SIGFRAME, RXDATAX, RXDATA, RXDATAXP,
        TXDATAX, TXDATA, IF, IFS, IFC, IEN, PULSECTRL, FREEZE, SYNCBUSY;
} LEUART_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD, STATUS, IEN, IF, IFS, IFC, DATA, XORDATA, RESERVED0[3], KEYLA, KEYLB,
        KEYLC, KEYLD, KEYHA, KEYHB, KEYHC, KEYHD;
} AES_TypeDef;

typedef struct {
    __IO uint32_t TIMING, INTERACT, EVAL, RESERVED0;
} LESENSE_CH_TypeDef;

typedef struct {
    __IO uint32_t CTRL, TIMCTRL, PERCTRL, DECCTRL, BIASCTRL, CMD, CHEN, SCANRES, STATUS, PTR,
        BUFDATA, CURCH, DECSTATE, SENSORSTATE, IDLECONF, ALTEXCONF, IF, IFC, IFS, IEN, SYNCBUSY,
        ROUTE, POWERDOWN, RESERVED0[105], ST[32], BUF[16];
    LESENSE_CH_TypeDef CH[16];
} LESENSE_TypeDef;

typedef struct {
    __IO uint32_t CTRL, LOAD, VAL, CALIB;
} SysTick_Type;

typedef struct {
    __IO uint32_t CPUID, ICSR, VTOR, AIRCR, SCR, CCR;
    __IO uint8_t SHP[12];
    __IO uint32_t SHCSR, CFSR, HFSR, DFSR, MMFAR, BFAR, AFSR;
} SCB_Type;

#define CMU ((CMU_TypeDef *)0x400C8000UL)
#define GPIO ((GPIO_TypeDef *)0x40006000UL)
#define UART0 ((USART_TypeDef *)0x4000E000UL)
#define I2C0 ((I2C_TypeDef *)0x4000A000UL)
#define DMA ((DMA_TypeDef *)0x400C2000UL)
#define ADC0 ((ADC_TypeDef *)0x40002000UL)
#define TIMER0 ((TIMER_TypeDef *)0x40010000UL)
#define PRS ((PRS_TypeDef *)0x400CC000UL)
#define RTC ((RTC_TypeDef *)0x40080000UL)
#define BURTC ((BURTC_TypeDef *)0x40081000UL)
#define LETIMER0 ((LETIMER_TypeDef *)0x40082000UL)
#define MSC ((MSC_TypeDef *)0x400C0000UL)
#define WDOG ((WDOG_TypeDef *)0x40088000UL)
#define ACMP0 ((ACMP_TypeDef *)0x40001000UL)
#define VCMP ((VCMP_TypeDef *)0x40000000UL)
#define DAC0 ((DAC_TypeDef *)0x40004000UL)
#define PCNT0 ((PCNT_TypeDef *)0x40086000UL)
#define LEUART0 ((LEUART_TypeDef *)0x40084000UL)
#define AES ((AES_TypeDef *)0x400E0000UL)
#define LESENSE ((LESENSE_TypeDef *)0x4008C000UL)
#define RMU ((RMU_TypeDef *)0x400CA000UL)
#define SysTick ((SysTick_Type *)0xE000E010UL)
#define SCB ((SCB_Type *)0xE000ED00UL)
#define NVIC_ISER ((__IO uint32_t *)0xE000E100UL)
enum {
    DMA_IRQn = 0, ACMP0_IRQn = 6, ADC0_IRQn = 7, I2C0_IRQn = 9, LESENSE_IRQn = 17,
    UART0_RX_IRQn = 20, LEUART0_IRQn = 24, LETIMER0_IRQn = 26, PCNT0_IRQn = 27, RTC_IRQn = 30,
    BURTC_IRQn = 31, VCMP_IRQn = 33, MSC_IRQn = 35, AES_IRQn = 36
};

static inline void NVIC_EnableIRQ(int irq) { NVIC_ISER[irq >> 5] = 1UL << (irq & 31); }
static inline void __WFI(void) { __asm volatile("wfi" ::: "memory"); }
static inline void __disable_irq(void) { __asm volatile("cpsid i" ::: "memory"); }

#define CMU_CTRL_HFLE (1UL << 30)
#define CMU_HFCORECLKDIV_LEDIV4 (1UL << 8)
#define CMU_OSCENCMD_HFXOEN (1UL << 2)
#define CMU_OSCENCMD_HFRCODIS (1UL << 1)
#define CMU_OSCENCMD_LFXOEN (1UL << 8)
#define CMU_CMD_HFCLKSEL_HFXO 2UL
#define CMU_OSCENCMD_LFRCOEN (1UL << 6)
#define CMU_STATUS_LFRCORDY (1UL << 7)
#define CMU_STATUS_HFXORDY (1UL << 3)
#define CMU_STATUS_LFXORDY (1UL << 9)
#define CMU_STATUS_HFXOSEL (1UL << 11)
#define CMU_HFCORECLKEN0_DMA (1UL << 0)
#define CMU_HFCORECLKEN0_LE (1UL << 4)
#define CMU_HFCORECLKEN0_AES (1UL << 1)
#define CMU_HFPERCLKEN0_ACMP0 (1UL << 9)
#define CMU_HFPERCLKEN0_ACMP1 (1UL << 10)
#define CMU_HFPERCLKEN0_VCMP (1UL << 14)
#define CMU_HFPERCLKEN0_DAC0 (1UL << 17)
#define CMU_HFPERCLKEN0_UART0 (1UL << 3)
#define CMU_HFPERCLKEN0_TIMER0 (1UL << 5)
#define CMU_HFPERCLKEN0_PRS (1UL << 15)
#define CMU_HFPERCLKEN0_ADC0 (1UL << 16)
#define CMU_HFPERCLKEN0_I2C0 (1UL << 11)
#define CMU_HFPERCLKEN0_GPIO (1UL << 13)
#define CMU_LFACLKEN0_LESENSE (1UL << 0)
#define CMU_LFBCLKEN0_LEUART0 (1UL << 0)
#define CMU_LFACLKEN0_RTC (1UL << 1)
#define CMU_LFACLKEN0_LETIMER0 (1UL << 2)

#define MSC_READCTRL_MODE_WS2 4UL
#define USART_CMD_RXEN (1UL << 0)
#define USART_CMD_TXEN (1UL << 2)
#define USART_STATUS_TXC (1UL << 5)
#define USART_STATUS_TXBL (1UL << 6)

// Of startup.c: 48 MHz from the crystal, UART0 at 115200 baud on PE0 and PE1.
void SystemInit(void);
void console_init(void);
void console_put(char c);
void console_write(const char *text);
void console_hex(uint32_t value);

#endif
