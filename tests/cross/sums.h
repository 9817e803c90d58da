/* Answers of all kinds, summed up bit by bit: every target must print what is in expected.txt. Freestanding
 * C: it needs no more than the library and `say`. */
#ifndef SUMS_H
#define SUMS_H

#include <stdint.h>

/* Prints a line: the mesh, the method, the query, and the sum of the answers. */
void say(const char *mesh, const char *method, const char *what, uint64_t sum);

/* Prints all sums for the methods that the library has; returns 0, or the number of the step that failed. */
int sums(void);

#endif
