/* A picture, or some rows of it, tile by tile, on threads. */
#ifndef RENDER_H
#define RENDER_H

#include "camera.h"
#include "progress.h"

#include <hgrid.h>

#include <stdbool.h>

enum { MAX_SIZE = 16384 };

/* What is to be drawn. Initialise it with zeros and set what you need. */
typedef struct {
    const hgrid_grid *grid;
    const camera *camera;
    /* Pixels on each side of the whole picture, and the rows that are drawn. */
    int size, first_row, row_count;
    /* Whether the lamp casts shadows, and how many rays look for the sky at each hit; with none all
     * of it is seen. */
    bool has_shadows;
    int sky_rays;
    /* Red, green, blue of each pixel of these rows. */
    unsigned char *pixels;
    /* The work for each pixel of these rows, with all its rays; or NULL, which is faster. */
    uint32_t *tests, *steps;
    /* How many threads draw, at least 1. The picture does not depend on it. */
    uint32_t threads;
    /* NULL: no progress is reported. */
    progress *progress;
} picture_job;

/* Draws; returns how many rays from the camera hit. */
size_t render(const picture_job *job);

#endif
