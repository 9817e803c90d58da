/* What a program without an operating system starts with: vectors, RAM, and a line to the debugger. */
#ifndef START_H
#define START_H

#include <stddef.h>
#include <stdint.h>

/* The program; what it returns is the exit status that the debugger sees. */
int run(void);

/* Prints through the debugger (semihosting): QEMU with -semihosting, OpenOCD, J-Link. */
void print(const char *text);
void print_number(uint32_t number);
void print_sum(uint64_t sum);

/* Forgets how deep the stack was, and tells how many bytes below here were used since. */
void paint_stack(void);
size_t used_stack(void);

/* Ticks of the processor's clock since the start, as SysTick counts them. Under QEMU with `-icount shift=0`
 * the clock of mps2-an386 ticks once in 40 instructions. */
uint32_t ticks(void);

#endif
