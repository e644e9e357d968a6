// A kernel with two tasks and without a tick: while both wait, it sleeps in EM2 until the compare
// value of the next one. The counter is the RTC, or the BURTC with ON_BURTC.
#include "device.h"

#define TASKS 3
#define STACK_WORDS 128
#define IDLE 2
#define ROUNDS 8

#ifdef ON_BURTC
#define NAME "burtc "
#define COUNTER BURTC
#define COUNTER_IRQn BURTC_IRQn
#define COMPARE 2UL            // COMP0 of IF
#define MASK 0xFFFFFFFFUL
#else
#define NAME "rtc "
#define COUNTER RTC
#define COUNTER_IRQn RTC_IRQn
#define COMPARE 2UL
#define MASK 0xFFFFFFUL
#endif

static uint32_t stacks[TASKS][STACK_WORDS] __attribute__((aligned(8)));
static uint32_t *saved[TASKS];
static volatile uint32_t current, wakes_at[TASKS], waits[TASKS], sleeps, interrupts, late, worst;

static uint32_t now(void) { return COUNTER->CNT & MASK; }
static int passed(uint32_t time) { return ((now() - time) & MASK) < MASK / 2; }

static void switch_task(void) { SCB->ICSR = 1UL << 28; }

static void on_compare(void) {
    COUNTER->IFC = COMPARE;
    interrupts++;
    switch_task();
}
#ifdef ON_BURTC
void BURTC_IRQHandler(void) { on_compare(); }
#else
void RTC_IRQHandler(void) { on_compare(); }
#endif

__attribute__((used)) uint32_t *switch_from(uint32_t *sp) {
    saved[current] = sp;
    current = IDLE;
    for (uint32_t task = 0; task < IDLE; task++)
        if (!waits[task] || passed(wakes_at[task])) {
            current = task;
            break;
        }
    return saved[current];
}

__attribute__((naked)) void PendSV_Handler(void) {
    __asm volatile(
        "mrs r0, psp\n"
        "stmdb r0!, {r4-r11}\n"
        "push {r3, lr}\n"
        "bl switch_from\n"
        "pop {r3, lr}\n"
        "ldmia r0!, {r4-r11}\n"
        "msr psp, r0\n"
        "bx lr\n");
}

// Starts the idle task in thread mode on its stack.
__attribute__((naked)) void SVC_Handler(void) {
    __asm volatile(
        "ldr r0, =saved\n"
        "ldr r0, [r0, #8]\n"
        "ldmia r0!, {r4-r11}\n"
        "msr psp, r0\n"
        "mvn lr, #2\n"
        "bx lr\n");
}

static void wait_until(uint32_t time) {
    wakes_at[current] = time & MASK;
    waits[current] = 1;
    switch_task();
    __asm volatile("dsb\nisb" ::: "memory");
    waits[current] = 0;
    const uint32_t delay = (now() - time) & MASK;
    if (delay > MASK / 2) late = 1;    // too early
    else if (delay > worst) worst = delay;
}

static volatile uint32_t done[IDLE];

static void task(uint32_t number, uint32_t period) {
    uint32_t time = now();
    for (int i = 0; i < ROUNDS; i++) {
        time += period;
        wait_until(time);
        done[number]++;
    }
    for (;;) wait_until(now() + 0x10000);
}
static void fast(void) { task(0, 1000); }
static void slow(void) { task(1, 2531); }

static void idle(void) {
    for (;;) {
        if (done[0] == ROUNDS && done[1] == ROUNDS) {
            __disable_irq();
            CMU->OSCENCMD = CMU_OSCENCMD_HFXOEN;
            while (!(CMU->STATUS & CMU_STATUS_HFXORDY)) ;
            CMU->CMD = CMU_CMD_HFCLKSEL_HFXO;
            console_write(NAME);
            console_hex(late << 31 | worst);
            console_write(sleeps >= 2 * ROUNDS - 4 && interrupts <= sleeps ? " slept\n" : " awake\n");
            while (!(UART0->STATUS & USART_STATUS_TXC)) ;
            for (;;) __WFI();
        }
        __disable_irq();
        uint32_t next = now() + 0x10000;
        for (int i = 0; i < IDLE; i++)
            if (((next - wakes_at[i]) & MASK) < MASK / 2) next = wakes_at[i];
        if (((next - now()) & MASK) > 2 && !passed(next)) {
            COUNTER->COMP0 = next & MASK;
            while (COUNTER->SYNCBUSY) ;
            if (!passed(next - 2)) sleeps++, __WFI();
        }
        __asm volatile("cpsie i\nisb" ::: "memory");
        switch_task();
    }
}

int main(void) {
    console_init();
    void (*const entries[TASKS])(void) = {fast, slow, idle};
    for (int i = 0; i < TASKS; i++) {
        uint32_t *sp = stacks[i] + STACK_WORDS - 16;
        sp[14] = (uint32_t)entries[i];
        sp[15] = 0x01000000;
        saved[i] = sp;
    }
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    CMU->OSCENCMD = CMU_OSCENCMD_LFXOEN;
    while (!(CMU->STATUS & CMU_STATUS_LFXORDY)) ;
#ifdef ON_BURTC
    RMU->CTRL &= ~2UL;                             // BURSTEN: out of reset
    BURTC->CTRL = 1 | 2UL << 12;                   // counts in EM2, LFXO
#else
    CMU->LFCLKSEL = (CMU->LFCLKSEL & ~3UL) | 2;    // LFXO to the A branch
    CMU->LFACLKEN0 |= CMU_LFACLKEN0_RTC;
    while (CMU->SYNCBUSY) ;
    RTC->CTRL = 1;
#endif
    while (COUNTER->SYNCBUSY) ;
    COUNTER->IFC = 7;
    COUNTER->IEN = COMPARE;
    NVIC_EnableIRQ(COUNTER_IRQn);
    SCB->SHP[10] = 0xE0;                           // PendSV last
    SCB->SCR = 1UL << 2;                           // deep sleep
    current = IDLE;
    __asm volatile("svc 0");
    for (;;) ;
}
