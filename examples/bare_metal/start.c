/* See start.h. For Cortex-M of all kinds: it uses no assembly but the trap to the debugger. */

#include "start.h"

extern uint32_t data_start[], data_end[], data_image[], bss_start[], bss_end[];
extern uint32_t stack_bottom[], stack_top[];

void start(void);
static void fault(void);
static void overflow(void);

/* The start of flash: the initial stack pointer, then the handlers of exceptions 1 to 15. */
struct vectors {
    uint32_t *stack;
    void (*handlers[15])(void);
};

__attribute__((section(".vectors"), used)) static const struct vectors vectors = {
    stack_top,
    {start, fault, fault, fault, fault, fault, NULL, NULL, NULL, NULL, fault, NULL, NULL, fault,
     overflow}};

/* Registers that all Cortex-M have. */
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SYSTICK_CONTROL REGISTER(0xe000e010)
#define SYSTICK_RELOAD REGISTER(0xe000e014)
#define SYSTICK_VALUE REGISTER(0xe000e018)
#define CONFIGURATION REGISTER(0xe000ed14)
#define COPROCESSORS REGISTER(0xe000ed88)
enum { SYSTICK_TICKS = 0x1000000 };

/* Calls the debugger by semihosting: an operation in r0, its parameter in r1. */
static uint32_t ask_debugger(uint32_t operation, const void *parameter)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = parameter;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void print(const char *text)
{
    ask_debugger(0x04, text);
}

void print_number(uint32_t number)
{
    char text[11], *at = text + 10;
    *at = 0;
    do
        *--at = (char)('0' + number % 10);
    while (number /= 10);
    print(at);
}

void print_sum(uint64_t sum)
{
    char text[17];
    for (int i = 0; i < 16; i++)
        text[i] = "0123456789abcdef"[sum >> (60 - 4 * i) & 15];
    text[16] = 0;
    print(text);
}

/* Ends QEMU with an exit status. */
static void leave(uint32_t status)
{
    const uint32_t block[2] = {0x20026, status};
    ask_debugger(0x20, block);
    ask_debugger(0x18, (const void *)(uintptr_t)(status ? 0x20023 : 0x20026));
    for (;;) {
    }
}

static void fault(void)
{
    print("fault\n");
    leave(2);
}

/* The value of an untouched word of the stack. */
enum { UNTOUCHED = 0x5aa5c33c };

__attribute__((noinline)) void paint_stack(void)
{
    uint32_t here;
    /* Leaves out 64 bytes, which this function's own frame may use. */
    uint32_t *const end = (uint32_t *)(((uintptr_t)&here & ~(uintptr_t)3) - 64);
    for (volatile uint32_t *at = stack_bottom; at < end; at++)
        *at = UNTOUCHED;
}

__attribute__((noinline)) size_t used_stack(void)
{
    uint32_t here;
    const volatile uint32_t *at = stack_bottom;
    while (at < &here && *at == UNTOUCHED)
        at++;
    return (size_t)((uintptr_t)&here - (uintptr_t)at);
}

static volatile uint32_t overflows;

static void overflow(void)
{
    overflows++;
}

uint32_t ticks(void)
{
    uint32_t before, value;
    do {
        before = overflows;
        value = SYSTICK_VALUE;
    } while (before != overflows);
    return before * (uint32_t)SYSTICK_TICKS + (SYSTICK_TICKS - 1 - value);
}

__attribute__((noreturn, used)) void start(void)
{
    /* `volatile`, because the compiler would otherwise call memcpy before its data exist. */
    const volatile uint32_t *from = data_image;
    for (volatile uint32_t *to = data_start; to < data_end;)
        *to++ = *from++;
    for (volatile uint32_t *to = bss_start; to < bss_end;)
        *to++ = 0;
#ifdef __ARM_FP
    /* Enables the coprocessors 10 and 11, the floating-point unit: without them its first instruction is a fault. */
    COPROCESSORS |= 0xfu << 20;
    __asm__ volatile("dsb\n\tisb" ::: "memory");
#endif
#ifdef TRAP_UNALIGNED
    CONFIGURATION |= 1u << 3;
#endif
    SYSTICK_RELOAD = SYSTICK_TICKS - 1, SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = 7;
    leave((uint32_t)run());
    for (;;) {
    }
}
