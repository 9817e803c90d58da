/* A grid in memory from malloc. */
#ifndef GRID_H
#define GRID_H

#include "memory.h"
#include "progress.h"
#include "scene.h"

#include <hgrid.h>

/* The methods by their names, with their default parameters. */
typedef struct {
    const char *name;
    hgrid_config config;
} method;

enum { METHOD_COUNT = 5 };
extern const method METHODS[METHOD_COUNT];

/* A grid, with the facts about its build. */
typedef struct {
    hgrid_grid grid;
    /* The memory of the grid. */
    region index;
    hgrid_report report;
    size_t scratch_bytes;
    /* The time of hgrid_sizes and of malloc, and that of the build alone. */
    double sizes_seconds, build_seconds;
} built_grid;

/* Returns the mesh for hgrid, which reads its arrays in place at every query. */
hgrid_mesh mesh_of(const scene *s);

/* Builds on up to so many threads, or ends the program with the reason. The progress may be NULL: then none
 * is reported. */
built_grid build_grid(const hgrid_mesh *mesh, const hgrid_config *config, uint32_t threads,
                      progress *p);

/* Ends the program if the status is an error. The report may be NULL. */
void check(hgrid_status status, const hgrid_report *report);

#endif
