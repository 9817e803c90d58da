/* Traces rays in a grid, and prints the cost. */
#ifndef MEASURE_H
#define MEASURE_H

#include <hgrid.h>

/* Prints "NAME: N instructions a UNIT, N bytes of stack", for the work since `ticks_before`. */
void tell(const char *name, const char *unit, uint32_t ticks_before, uint32_t count);

/* Traces the camera's rays by all kinds of queries. */
void trace(const hgrid_grid *grid);

#endif
