/* A grid, in memory that malloc gave. */
#ifndef GRID_H
#define GRID_H

#include "memory.h"
#include "progress.h"
#include "scene.h"

#include <hgrid.h>

/* The methods by their names, with their usual numbers. */
typedef struct {
    const char *name;
    hgrid_config config;
} method;

enum { METHOD_COUNT = 5 };
extern const method METHODS[METHOD_COUNT];

/* A grid and what there is to know about it. */
typedef struct {
    hgrid_grid grid;
    /* Where it lies. */
    region index;
    hgrid_report report;
    size_t scratch_bytes;
    /* The time of asking for sizes and of malloc, and that of the build alone. */
    double sizes_seconds, build_seconds;
} built_grid;

/* The mesh as hgrid wants to know it: it will be read where it is, at every query. */
hgrid_mesh mesh_of(const scene *s);

/* Builds on so many threads, as far as the method can use them, or ends the program with the reason.
 * The progress may be NULL: then none is reported. */
built_grid build_grid(const hgrid_mesh *mesh, const hgrid_config *config, uint32_t threads,
                      progress *p);

/* Ends the program unless all is well. The report may be NULL. */
void check(hgrid_status status, const hgrid_report *report);

#endif
