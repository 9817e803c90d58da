/* Answers of all kinds, summed up bit by bit: a target that computes what all others do prints what is
 * in expected.txt. Freestanding C: it needs no more than the library and `say`. */
#ifndef SUMS_H
#define SUMS_H

#include <stdint.h>

/* Prints a line: which mesh, which method, what was asked, and the sum of the answers. */
void say(const char *mesh, const char *method, const char *what, uint64_t sum);

/* Says all sums of what the library has; returns 0, or the number of the step that failed. */
int sums(void);

#endif
