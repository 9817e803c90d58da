#include "grid.h"

#include "threads.h"

#include <stdbool.h>
#include <stdlib.h>

const method METHODS[METHOD_COUNT] = {
    {"bvh", HGRID_CONFIG_INIT},
    {"one-level", HGRID_CONFIG_INIT_ONE_LEVEL},
    {"fixed", HGRID_CONFIG_INIT_FIXED},
    {"variable", HGRID_CONFIG_INIT_VARIABLE},
    {"recursive", HGRID_CONFIG_INIT_RECURSIVE},
};

void check(hgrid_status status, const hgrid_report *report)
{
    if (status == HGRID_OK)
        return;
    if (report != NULL && report->triangle != HGRID_INVALID_ID)
        fail("triangle %lu: %s", (unsigned long)report->triangle, hgrid_status_string(status));
    fail("%s", hgrid_status_string(status));
}

hgrid_mesh mesh_of(const scene *s)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = s->positions;
    mesh.vertex_count = s->vertex_count;
    mesh.indices = s->indices;
    mesh.triangle_count = s->triangle_count;
    return mesh;
}

/* Returns true if the bound of a method's index is far more than a mesh needs. */
static bool has_loose_bound(const hgrid_config *config)
{
    return config->method == HGRID_METHOD_VARIABLE || config->method == HGRID_METHOD_RECURSIVE;
}

/* Computes and allocates the memory of the grid; returns the scratch.
 *
 * Without scratch, hgrid_sizes returns a bound of the index, not its exact size; pages that are never
 * touched cost nothing. For two methods the bound is far too large. So hgrid_sizes is called again for
 * them, with scratch, which takes up to the time of a build. */
static region allocate_grid(const hgrid_mesh *mesh, const hgrid_config *config, region *index)
{
    hgrid_report report = HGRID_REPORT_INIT;
    check(hgrid_sizes(mesh, config, NULL, 0, &report), &report);
    const region scratch = allocate_region(report.scratch_bytes);
    if (has_loose_bound(config))
        check(hgrid_sizes(mesh, config, scratch.start, scratch.bytes, &report), &report);
    *index = allocate_region(report.index_bytes);
    return scratch;
}

/* Shows the progress that hgrid reports; returning false would end the build. */
static bool go_on(void *context, uint32_t done)
{
    show_progress((progress *)context, (double)done / HGRID_PROGRESS_END);
    return true;
}

built_grid build_grid(const hgrid_mesh *mesh, const hgrid_config *config, uint32_t threads,
                      progress *p)
{
    built_grid b;
    const hgrid_report empty = HGRID_REPORT_INIT;
    b.report = empty;
    hgrid_config how = *config;
    how.tasks = threads, how.run = run_on_threads;
    how.context = p, how.progress = p != NULL ? go_on : NULL;

    const double start = now();
    const region scratch = allocate_grid(mesh, &how, &b.index);
    const double allocated = now();
    check(hgrid_build(mesh, &how, b.index.start, b.index.bytes, scratch.start, scratch.bytes,
                      &b.grid, &b.report),
          &b.report);
    const double built = now();

    b.scratch_bytes = scratch.bytes;
    b.sizes_seconds = allocated - start;
    b.build_seconds = built - allocated;
    free(scratch.allocation);
    return b;
}
