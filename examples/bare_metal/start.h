/* The start of a program without an operating system: vectors, RAM, and output to the debugger. */
#ifndef START_H
#define START_H

#include <stddef.h>
#include <stdint.h>

/* Runs the program; the debugger gets the result as exit status. */
int run(void);

/* Prints through the debugger (semihosting): QEMU with -semihosting, OpenOCD, J-Link. */
void print(const char *text);
void print_number(uint32_t number);
void print_sum(uint64_t sum);

/* Fills the unused stack with a pattern, and counts the bytes below here that were used since. */
void paint_stack(void);
size_t used_stack(void);

/* Returns the ticks of the processor's clock since the start, as SysTick counts them. Under QEMU with
 * `-icount shift=0` the clock of mps2-an386 ticks once in 40 instructions. */
uint32_t ticks(void);

#endif
