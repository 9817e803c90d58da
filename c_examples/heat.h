/* Pictures of work: a colour for each pixel, and a bar that says what the colours mean. */
#ifndef HEAT_H
#define HEAT_H

#include <stdint.h>
#include <stdio.h>

/* Writes and closes the file. Below pictures that are wide enough for its numbers there is a bar:
 *
 *     +-----------------------+
 *     |        picture        |   The scale ends at a round number no less than what 99 of 100
 *     +-----------------------+   pixels take: a few along an edge must not darken the picture.
 *     | TESTS                 |
 *     | [dark ........ light] |
 *     | 0        30       60+ |
 *     +-----------------------+
 */
void write_heat(FILE *file, const char *path, int size, const uint32_t *work, const char *name);

#endif
