/* Asks a grid, and prints what that takes. */
#ifndef MEASURE_H
#define MEASURE_H

#include <hgrid.h>

/* Prints "NAME: N instructions a UNIT, N bytes of stack", for what was done since the ticks. */
void tell(const char *name, const char *unit, uint32_t ticks_before, uint32_t count);

/* Traces the camera's rays in all ways. */
void trace(const hgrid_grid *grid);

#endif
