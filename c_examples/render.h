/* A picture, or some rows of it, tile by tile, on threads. */
#ifndef RENDER_H
#define RENDER_H

#include "camera.h"
#include "progress.h"

#include <hgrid.h>

#include <stdbool.h>

enum { MAX_SIZE = 16384 };

/* A picture to draw. Initialise it with zeros and set the fields that you need. */
typedef struct {
    const hgrid_grid *grid;
    const camera *camera;
    /* Pixels on each side of the whole picture, and the rows to draw. */
    int size, first_row, row_count;
    /* True if the lamp casts shadows, and the number of rays toward the sky at each hit; 0 for no ambient
     * occlusion. */
    bool has_shadows;
    int sky_rays;
    /* The colours to write: red, green, blue of each pixel of these rows. */
    unsigned char *pixels;
    /* The work to write for each pixel of these rows, with all its rays; NULL, which is faster, for none. */
    uint32_t *tests, *steps;
    /* The number of threads that draw, at least 1. The picture does not depend on it. */
    uint32_t threads;
    /* NULL: no progress is reported. */
    progress *progress;
} picture_job;

/* Draws; returns the number of camera rays that hit. */
size_t render(const picture_job *job);

#endif
