/* Heat pictures: the work of each pixel as a colour, with a labelled colour bar. */
#ifndef HEAT_H
#define HEAT_H

#include <stdint.h>
#include <stdio.h>

/* Writes and closes the file. A bar is drawn below pictures that are wide enough for its numbers:
 *
 *     +-----------------------+
 *     |        picture        |   At least 99 of 100 pixels are on the scale, which ends at a
 *     +-----------------------+   round number. A few costly pixels would darken all others.
 *     | TESTS                 |
 *     | [dark ........ light] |
 *     | 0        30       60+ |
 *     +-----------------------+
 */
void write_heat(FILE *file, const char *path, int size, const uint32_t *work, const char *name);

#endif
