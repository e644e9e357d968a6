// Three tasks with own stacks, switched by SysTick and PendSV; two of them share a queue.
#include "device.h"

#define TASKS 3
#define STACK_WORDS 128

typedef struct {
    uint32_t *sp;
} Task;

static uint32_t stacks[TASKS][STACK_WORDS] __attribute__((aligned(8)));
Task tasks[TASKS];
volatile uint32_t current, ticks;
static volatile uint32_t queue[4], head, tail, counts[TASKS];

void SysTick_Handler(void) {
    ticks++;
    SCB->ICSR = 1UL << 28;
}

__attribute__((used)) uint32_t *switch_from(uint32_t *sp) {
    tasks[current].sp = sp;
    current = (current + 1) % TASKS;
    return tasks[current].sp;
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

// Start the first task: to thread mode on its stack.
__attribute__((naked)) void SVC_Handler(void) {
    __asm volatile(
        "ldr r0, =tasks\n"
        "ldr r0, [r0]\n"
        "ldmia r0!, {r4-r11}\n"
        "msr psp, r0\n"
        "mvn lr, #2\n"
        "bx lr\n");
}

static void producer(void) {
    for (uint32_t value = 1;; value++) {
        while (head - tail == 4) ;
        queue[head % 4] = value * value;
        head++;
        counts[0]++;
    }
}

static void consumer(void) {
    for (uint32_t sum = 0, n = 0;;) {
        while (head == tail) ;
        sum += queue[tail % 4];
        tail++;
        counts[1]++;
        if (++n == 100) {
            console_write("sum ");
            console_hex(sum);
            console_put('\n');
        }
    }
}

static void idle(void) {
    for (;;) {
        counts[2]++;
        __WFI();
    }
}

int main(void) {
    console_init();
    void (*const entries[TASKS])(void) = {producer, consumer, idle};
    for (int i = 0; i < TASKS; i++) {
        uint32_t *sp = stacks[i] + STACK_WORDS - 16;
        sp[14] = (uint32_t)entries[i];
        sp[15] = 0x01000000;
        tasks[i].sp = sp;
    }
    SCB->SHP[10] = 0xE0;  // PendSV last
    SCB->SHP[11] = 0xC0;  // SysTick before it
    SysTick->LOAD = 48000 - 1;
    SysTick->VAL = 0;
    SysTick->CTRL = 7;
    __asm volatile("svc 0");
    for (;;) ;
}
